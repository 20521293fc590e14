// Makes the golden vectors with this machine's build: golden_vectors FOLDER writes there
//   vectors.golden   what is asked and answered, case by case (golden.hpp, replay.cpp)
//   float64.image    the model image, as trocar scene compile makes it
//   float32.image    the same for a build in float32
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/condense/compile.hpp"
#include "common/config/rig_file.hpp"
#include "common/needle/tube.hpp"
#include "common/scene/scene.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/plant/plant_file.hpp"
#include "tests/targets/cases.hpp"

namespace trocar::targets {
namespace {

constexpr double face_m = 0.213;  // of the tissue in scene.toml
constexpr double needle_m = 0.1;

// Reader's other half.
class Writer {
 public:
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(const T& value) {
    if constexpr (std::is_floating_point_v<T>)
      put(static_cast<double>(value));
    else
      put(static_cast<std::int64_t>(value));
  }
  template <class T, std::size_t n>
  void operator()(const std::array<T, n>& values) {
    for (const T& value : values) (*this)(value);
  }
  // For a build in float32: whatever is made of float64 is rounded.
  template <class T>
  void view(const std::span<const T>& elements) {
    put(static_cast<std::int64_t>(elements.size()));
    if constexpr (std::is_same_v<T, double> || std::is_same_v<T, model::Vector2> || std::is_same_v<T, element::Material>) {
      const auto* const number = reinterpret_cast<const double*>(elements.data());
      for (std::size_t k = 0; k < elements.size_bytes() / sizeof(double); ++k) put(static_cast<float>(number[k]));
    } else {
      for (const T& element : elements) put(element);
    }
    bytes.resize((bytes.size() + 7) / 8 * 8);
  }

  std::vector<std::byte> bytes;

 private:
  template <class T>
  void put(const T& value) {
    const auto* const from = reinterpret_cast<const std::byte*>(&value);
    bytes.insert(bytes.end(), from, from + sizeof value);
  }
};

std::uint64_t no_clock() { return 0; }

// Asks all vectors, then appends the case to `out`; returns the answers.
template <class Case>
std::vector<Answer> add(Writer& out, const char* name, Kind kind, const model::Image& image, const Writer& beginning,
                        const std::vector<Writer>& vectors) {
  static Memory memory;
  const auto fresh = std::make_unique<Case>();
  Reader begins(beginning.bytes);
  fresh->open(begins, memory, image);
  std::array<double, most_quantities> scale{};
  std::vector<Answer> answers;
  for (const Writer& vector : vectors) {
    Answer answer{};
    Reader in(vector.bytes);
    fresh->step(in, answer, no_clock);
    if (!in.ok() || !in.at_end()) throw std::logic_error(std::string(name) + ": a vector is not read as it is written");
    std::size_t i = 0;
    for (std::size_t q = 0; q < Case::quantities.size(); ++q)
      for (std::size_t c = 0; c < Case::quantities[q].size; ++c, ++i)
        if (std::isfinite(answer.value[i])) scale[q] = std::max(scale[q], std::abs(answer.value[i]));
    if (i != answer.values) throw std::logic_error(std::string(name) + ": its quantities are not its values");
    answers.push_back(answer);
  }
  out(kind);
  std::array<char, 24> letters{};
  std::copy_n(name, std::min(letters.size() - 1, std::string(name).size()), letters.begin());
  out(letters);
  out(static_cast<std::uint64_t>(vectors.size()));
  for (std::size_t q = 0; q < Case::quantities.size(); ++q) out(scale[q]);
  out.bytes.insert(out.bytes.end(), beginning.bytes.begin(), beginning.bytes.end());
  for (std::size_t k = 0; k < vectors.size(); ++k) {
    out.bytes.insert(out.bytes.end(), vectors[k].bytes.begin(), vectors[k].bytes.end());
    for (std::size_t i = 0; i < answers[k].values; ++i) out(answers[k].value[i]);
    for (std::size_t d = 0; d < answers[k].decisions; ++d) out(answers[k].decision[d]);
  }
  return answers;
}

// The closed loop in lock-step: what its controller was told, tick by tick, from the moment on when the drives run.
class Loop {
 public:
  Loop(const std::string& name, const model::Image* image)
      : rig(config::read_rig(share / "rigs" / (name + ".toml"))),
        needle({rig.haptic.fade_s}),
        bench(rig, sim_plant::read_plant(share / "plants" / (name + ".toml")), std::nullopt, 1, &needle),
        hand({}, {rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}) {
    needle.offer(image);
    for (int k = 0; bench.link().feedback().state != hal::LinkState::Operational; ++k) {
      if (k > 5000) throw std::runtime_error("the drives do not come up");
      bench.tick();
    }
  }

  void tick(int n) {
    for (int k = 0; k < n; ++k) {
      Writer vector;
      const std::int64_t now_ns = bench.now_ns();
      for (const Command& c : commands_) bench.mail().commands.push(c);
      bench.mail().commands.push({.session = session, .kind = CommandKind::KeepAlive});
      bench.tick();
      hal::Feedback told = bench.link().feedback();
      vector(now_ns);
      fields(vector, told);
      vector(session), vector(static_cast<std::uint32_t>(commands_.size()));
      for (Command& c : commands_) fields(vector, c);
      commands_.clear();
      vectors.push_back(std::move(vector));
      torques.push_back(bench.sample().joint_torque_command_nm);
    }
  }
  void send(Command c, int ticks) {
    c.session = session;
    c.id = ++id_;
    commands_.push_back(c);
    tick(ticks);
  }
  void arm() {
    tick(60);
    send({.kind = CommandKind::Home}, 5);
    send({.kind = CommandKind::Tare}, 255);
    send({.kind = CommandKind::Arm}, 60);
    expect(Mode::Armed);
  }
  void expect(Mode mode) {
    if (bench.sample().mode != mode) throw std::runtime_error(std::string("the loop is in mode ") + to_string(bench.sample().mode));
  }

  static constexpr std::uint64_t session = 1;
  std::filesystem::path share{TROCAR_SHARE};
  rig::Rig rig;
  virtual_needle::VirtualNeedle needle;
  sim_plant::Bench bench;
  sim_plant::Hand hand;
  std::vector<Writer> vectors;
  std::vector<std::array<double, 4>> torques;

 private:
  std::vector<Command> commands_;
  std::uint32_t id_{};
};

void add(Writer& out, const char* name, Loop& loop, const model::Image& image) {
  Writer beginning;
  fields(beginning, loop.rig);
  const std::vector<Answer> answers = add<TickCase>(out, name, Kind::Tick, image, beginning, loop.vectors);
  // The controller that ran in the loop and the one that was told the same afterwards.
  for (std::size_t k = 0; k < answers.size(); ++k)
    for (std::size_t i = 0; i < 4; ++i)
      if (answers[k].value[i] != loop.torques[k][i])
        throw std::logic_error(std::string(name) + ": tick " + std::to_string(k) + " does not repeat what the loop did");
}

void add_position(Writer& out, const model::Image& image) {
  const auto loop = std::make_unique<Loop>("ubc_twin", nullptr);
  loop->arm();
  const auto from = loop->bench.sample().pose;
  loop->send({.kind = CommandKind::Move,
              .target_pose = {from[0] + 0.01, from[1] + 0.02, from[2] + 0.3},
              .speed_m_s = 0.05,
              .angular_speed_rad_s = 1.0},
             400);
  loop->expect(Mode::Position);
  loop->send({.kind = CommandKind::Move, .target_pose = from, .speed_m_s = 0.05, .angular_speed_rad_s = 1.0}, 150);
  loop->send({.kind = CommandKind::Hold}, 100);
  loop->expect(Mode::Hold);
  loop->send({.kind = CommandKind::Stop}, 30);
  loop->expect(Mode::Ready);
  add(out, "tick, position", *loop, image);
}

void add_haptic(Writer& out, const model::Image& image) {
  const auto loop = std::make_unique<Loop>("ubc_twin_haptic", &image);
  loop->arm();
  loop->hand.hold(loop->bench.plant().physics().pose());
  loop->bench.give_to(&loop->hand);
  loop->tick(20);
  const auto at = loop->bench.plant().physics().pose();
  const double now_s = 1e-9 * static_cast<double>(loop->bench.now_ns());
  // Shaken in the air, pushed 30 mm in, a little aside and turning, and most of the way out again.
  loop->hand.want({{now_s, at},
                   {now_s + 0.12, {at[0] - 0.02, at[1] - 0.01, at[2] + 0.3}},
                   {now_s + 0.24, {at[0] + 0.02, at[1], at[2] - 0.1}},
                   {now_s + 0.4, at},
                   {now_s + 0.8, {at[0] + 0.002, at[1] + 0.03, at[2] + 0.03}},
                   {now_s + 1.2, at}});
  for (const Display display : {Display::FourChannel, Display::Impedance, Display::Admittance})
    loop->send({.kind = CommandKind::Haptic, .display = display}, 350);
  loop->expect(Mode::Haptic);
  add(out, "tick, haptic", *loop, image);
}

// So deep in, aside and turning, and out again; from 2.1 mm before the tissue, so that no step ends on an edge of the mesh: a contact
// begins there or a step later, as rounding wants.
void add_insertion(Writer& out, const char* name, const model::Image& image, contact::Method method, model::Needle needle,
                   double deepest_m) {
  Writer beginning;
  beginning(method);
  fields(beginning, needle);
  std::vector<Writer> vectors;
  const auto add_pose = [&](double depth_m, double aside_m, double turn_rad) {
    needle::Pose pose{aside_m, face_m - needle_m + depth_m, std::numbers::pi / 2 + turn_rad};
    Writer vector;
    fields(vector, pose);
    vector(1e-3 * (1.0 + 0.25 * std::sin(0.1 * static_cast<double>(vectors.size()))));
    vectors.push_back(std::move(vector));
  };
  constexpr int in = 190, rests = 3, back = 110;
  for (int k = 0; k <= in; ++k) {
    const double s = static_cast<double>(k) / in;
    add_pose(-0.0021 + (0.0021 + deepest_m) * s, 0.001 * s * s, 0.04 * s * s);
  }
  for (int k = 0; k < rests; ++k) add_pose(deepest_m, 0.001, 0.04);
  for (int k = 1; k <= back; ++k) {
    const double s = static_cast<double>(k) / back;
    add_pose(deepest_m - (deepest_m + 0.0041) * s, 0.001 - 0.001 * s, 0.04 * (1.0 - s));
  }
  add<InsertionCase>(out, name, Kind::Insertion, image, beginning, vectors);
}

// A 22G needle of 150 mm under loads that grow, turn and let go; the base turns with them.
void add_beam(Writer& out, const model::Image& image) {
  const needle::Section section = needle::section_of(0.718e-3, 0.413e-3, 200e9);
  Writer beginning;
  beginning(0.15), beginning(section.bending_nm2), beginning(section.axial_n), beginning(0.5), beginning(std::int64_t{24});
  std::vector<Writer> vectors;
  constexpr int steps = 120;
  for (int k = 0; k < steps; ++k) {
    const double s = std::sin(std::numbers::pi * k / (steps - 1));
    needle::Pose base{0.01 * s, 0.1 + 0.02 * s, std::numbers::pi / 2 + 0.5 * s};
    Writer vector;
    fields(vector, base);
    for (std::size_t i = 0; i < BeamCase::loads; ++i) {
      const double place = static_cast<double>(i + 1) / static_cast<double>(BeamCase::loads);
      const double turn = 0.8 * static_cast<double>(i) + 0.05 * k;
      const std::array<double, 2> force_n{0.08 * s * std::cos(turn), 0.08 * s * std::sin(turn)};
      vector(0.15 * place * (1.0 - 0.05 * s)), vector(force_n), vector(2e-4 * s * place);
    }
    vectors.push_back(std::move(vector));
  }
  add<BeamCase>(out, "beam", Kind::Beam, image, beginning, vectors);
}

// An unchanged file keeps its time, and what was built of it stays.
void write(const std::filesystem::path& file, std::span<const std::byte> bytes) {
  std::ifstream in(file, std::ios::binary);
  const std::vector<char> there{std::istreambuf_iterator<char>(in), {}};
  if (std::ranges::equal(std::as_bytes(std::span(there)), bytes)) return;
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

void write_all(const std::filesystem::path& folder) {
  condense::Options options;
  options.visible = condense::WithVisible::No;
  const image_file::AlignedBytes bytes = condense::compile_to_memory(scene::read_scene(TROCAR_TARGET_SCENE), options).image;
  model::Image image{};
  if (model::open(bytes.span(), image) != model::ImageStatus::Ok) throw std::runtime_error("the image cannot be opened");

  Writer out;
  add_position(out, image);
  add_haptic(out, image);
  model::Needle rigid = image.needle;
  add_insertion(out, "contact, embedded", image, contact::Method::Embedded, rigid, 0.036);
  // Not as far as the node at 30 mm: there the tip springs back through the place that the node was just moved to, and on which side of it
  // the tip is then, float64 and float32 decide differently.
  add_insertion(out, "contact, adapt", image, contact::Method::Adapt, rigid, 0.028);
  model::Needle bending = rigid;
  const needle::Section section = needle::section_of(0.718e-3, 0.413e-3, 200e9);
  bending.elements = 24;
  bending.bending_nm2 = section.bending_nm2;
  bending.axial_n = section.axial_n;
  bending.face_rad = 0.5;
  bending.tip_lateral = 0.5;
  add_insertion(out, "bending needle", image, contact::Method::Embedded, bending, 0.036);
  add_beam(out, image);
  out(Kind::End);

  std::filesystem::create_directories(folder);
  write(folder / "vectors.golden", out.bytes);
  write(folder / "float64.image", bytes.span());
  std::vector<float> rounded(image.tissue.compliance64.begin(), image.tissue.compliance64.end());
  if (!rounded.empty()) image.tissue.compliance32 = rounded;
  contact::Law law = *image.law;
  Writer float32;
  fields(float32, image, law);
  write(folder / "float32.image", float32.bytes);
}

}  // namespace
}  // namespace trocar::targets

int main(int count, char** argument) {
  if (count != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argument[0]);
    return 2;
  }
  try {
    trocar::targets::write_all(argument[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argument[0], error.what());
    return 1;
  }
  return 0;
}
