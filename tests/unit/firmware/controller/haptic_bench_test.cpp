// A person at the handle, in lock-step: the real controller with a virtual needle, the real bus, the simulated machine, an arm that wants
// to push the needle in and draw it out again.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "common/condense/compile.hpp"
#include "common/config/rig_file.hpp"
#include "common/scene/scene.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace trocar::sim_plant {
namespace {

using Pose = std::array<double, 3>;

struct Felt {
  double worst_step_n{};  // of the command in a tick
  double hand_error{};    // RMS of the estimated force against the hand's own, N
  double most_n{};        // the virtual needle's resistance
  double least_energy_j{};
  std::uint32_t most_contacts{};
  int unsolved{};
  long ticks{};
};

class Haptics {
 public:
  explicit Haptics(int encoder_counts = 16000, const HandConfig& hand = {}, const char* scene = "phantom")
      : scene_(scene::read_scene(share_ / "scenes" / (std::string(scene) + ".toml"))), hand_(hand, pose_of(rig_)) {
    rig_.actuation.encoder_counts_per_turn = encoder_counts;
    if (encoder_counts < 16000) rig_.haptic.observer_bandwidth_rad_s = 220.0;  // as much as 4,000 counts are admitted with
    if (control::admit(rig_).verdict != control::Admissible::Yes) throw std::runtime_error("the observer is not admitted");
    condense::Options options;
    options.visible = condense::WithVisible::No;
    bytes_ = condense::compile_to_memory(scene_, options).image;
    if (model::open(bytes_.span(), image_) != model::ImageStatus::Ok) throw std::runtime_error("the image cannot be opened");
    needle_.offer(&image_);
    bench_ = std::make_unique<Bench>(rig_, read_plant(share_ / "plants/ubc_twin_haptic.toml"), std::nullopt, 1, &needle_);
  }

  void tick(int n) {
    for (int i = 0; i < n; ++i) {
      bench_->mail().commands.push({.session = 1, .kind = CommandKind::KeepAlive});
      bench_->tick();
      Reply r;
      while (bench_->mail().replies.pop(r)) last_ = r.code;
      look();
    }
  }
  ReplyCode send(Command c, int ticks) {
    c.session = 1;
    c.id = ++id_;
    bench_->mail().commands.push(c);
    tick(ticks);
    return last_;
  }
  void arm() {
    tick(1500);
    send({.kind = CommandKind::Home}, 100);
    send({.kind = CommandKind::Tare}, 300);
    send({.kind = CommandKind::Arm}, 300);
  }
  // Takes the handle where it is.
  void take() {
    hand_.hold(bench_->plant().physics().pose());
    bench_->give_to(&hand_);
  }
  void delay_commands() { bench_->delay_commands(true); }
  void want(const std::vector<std::pair<double, Pose>>& way) {
    std::vector<Intention> points{{now_s(), bench_->plant().physics().pose()}};
    for (const auto& [seconds, pose] : way) points.push_back({points.back().time_s + seconds, pose});
    hand_.want(points);
  }
  [[nodiscard]] double now_s() { return 1e-9 * static_cast<double>(bench_->now_ns()); }
  [[nodiscard]] const Sample& sample() { return bench_->sample(); }
  [[nodiscard]] const Felt& felt() const { return felt_; }
  [[nodiscard]] Hand& hand() { return hand_; }
  [[nodiscard]] virtual_needle::VirtualNeedle& needle() { return needle_; }
  [[nodiscard]] const model::Image& image() const { return image_; }
  void forget() { felt_ = {}; }
  [[nodiscard]] static Pose pose_of(const rig::Rig& rig) { return {rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}; }

 private:
  void look() {
    const Sample& s = sample();
    if (s.mode == Mode::Haptic) {
      const double dx = s.wrench_command[0] - before_[0], dy = s.wrench_command[1] - before_[1];
      if (was_haptic_) felt_.worst_step_n = std::max(felt_.worst_step_n, std::hypot(dx, dy));
      const double ex = s.handle_wrench[0] - hand_.wrench()[0], ey = s.handle_wrench[1] - hand_.wrench()[1];
      felt_.hand_error = std::sqrt((felt_.hand_error * felt_.hand_error * static_cast<double>(felt_.ticks) + ex * ex + ey * ey) /
                                   static_cast<double>(felt_.ticks + 1));
      ++felt_.ticks;
      felt_.most_n = std::max(felt_.most_n, std::hypot(s.virtual_wrench[0], s.virtual_wrench[1]));
      felt_.least_energy_j = std::min(felt_.least_energy_j, s.display_energy_j);
      felt_.most_contacts = std::max(felt_.most_contacts, s.virtual_contacts);
      felt_.unsolved += s.virtual_status > 4 ? 1 : 0;
    }
    was_haptic_ = s.mode == Mode::Haptic;
    before_ = s.wrench_command;
  }

  std::filesystem::path share_{TROCAR_SHARE};
  rig::Rig rig_ = config::read_rig(share_ / "rigs/ubc_twin_haptic.toml");
  scene::Scene scene_;
  image_file::AlignedBytes bytes_;
  model::Image image_{};
  virtual_needle::VirtualNeedle needle_;
  Hand hand_;
  std::unique_ptr<Bench> bench_;
  ReplyCode last_{};
  std::uint32_t id_{};
  std::array<double, 3> before_{};
  bool was_haptic_{};
  Felt felt_;
};

class EveryDisplay : public testing::TestWithParam<Display> {};
INSTANTIATE_TEST_SUITE_P(HapticLoop, EveryDisplay, testing::Values(Display::FourChannel, Display::Impedance, Display::Admittance),
                         [](const auto& display) {
                           return display.param == Display::FourChannel ? "FourChannel"
                                  : display.param == Display::Impedance ? "Impedance"
                                                                        : "Admittance";
                         });

TEST_P(EveryDisplay, LetsAPersonPushTheNeedleInAndDrawItOut) {
  Haptics h;
  h.arm();
  ASSERT_EQ(h.sample().mode, Mode::Armed);
  h.take();
  h.tick(300);
  ASSERT_EQ(h.send({.kind = CommandKind::Haptic, .display = GetParam()}, 1000), ReplyCode::Done);
  ASSERT_EQ(h.sample().mode, Mode::Haptic) << to_string(h.sample().fault);
  Pose deep = h.sample().pose;
  deep[1] = 0.185;
  const Pose out = h.sample().pose;
  h.want({{5.0, deep}, {1.0, deep}, {5.0, out}});
  h.tick(5500);
  EXPECT_EQ(h.sample().mode, Mode::Haptic) << to_string(h.sample().fault);
  EXPECT_GT(h.sample().pose[1], 0.16);
  // At rest, deep in: what the hand pushes is what the needle resists with.
  h.tick(500);
  const double resists = h.sample().virtual_wrench[1];
  EXPECT_GT(resists, 0.3);
  EXPECT_NEAR(h.hand().wrench()[1], resists, 0.25);
  h.tick(6000);
  EXPECT_EQ(h.sample().mode, Mode::Haptic) << to_string(h.sample().fault);
  EXPECT_EQ(h.sample().virtual_contacts, 0U);
  const Felt& felt = h.felt();
  EXPECT_GT(felt.most_contacts, 5U);
  EXPECT_LT(felt.hand_error, 0.6);
  EXPECT_GT(felt.least_energy_j, -0.005);
  EXPECT_EQ(felt.unsolved, 0);
}

// Held in the stiffest tissue that there is by hands of half and twice the usual impedance, drives a millisecond late, coarse encoders, and
// after a jerk of the hand: nothing oscillates.
TEST_P(EveryDisplay, IsCalmInTheStiffestTissue) {
  const Display display = GetParam();
  for (const int counts : {4000, 16000})
    for (const double impedance : {0.5, 2.0}) {
      SCOPED_TRACE(testing::Message() << counts << " counts, hand " << impedance);
      Haptics h(counts, scaled({}, impedance), "layered");
      h.arm();
      h.take();
      h.tick(300);
      h.delay_commands();
      h.send({.kind = CommandKind::Haptic, .display = display}, 500);
      Pose deep = h.sample().pose;
      deep[1] = 0.18;
      const Pose aside{deep[0] + 0.004, deep[1] - 0.004, deep[2] + 0.05};
      h.want({{2.0, deep}, {0.2, deep}, {0.06, aside}, {0.06, deep}});
      h.tick(3500);
      EXPECT_GT(h.felt().most_n, 0.5);
      Pose most{}, least{};
      most.fill(-1e9);
      least.fill(1e9);
      for (int k = 0; k < 1000; ++k) {
        h.tick(1);
        for (std::size_t i = 0; i < 3; ++i) {
          most[i] = std::max(most[i], h.hand().wrench()[i]);
          least[i] = std::min(least[i], h.hand().wrench()[i]);
        }
      }
      EXPECT_EQ(h.sample().mode, Mode::Haptic) << to_string(h.sample().fault);
      EXPECT_GT(h.felt().least_energy_j, -0.01);
      // Four channels with a coarse encoder and a light hand: by where the needle stands within 4 mm, a limit cycle of the encoder's counts
      // of up to 0.11 N and 7 mN m, or none.
      const double calm_n = counts == 4000 && impedance < 1.0 ? 0.15 : 0.1;
      EXPECT_LT(0.5 * (most[0] - least[0]), calm_n);
      EXPECT_LT(0.5 * (most[1] - least[1]), calm_n);
      EXPECT_LT(0.5 * (most[2] - least[2]), calm_n * 0.05);
    }
}

TEST(HapticLoop, WantsAModelAndTheSession) {
  Haptics h;
  h.needle().offer(nullptr);
  h.tick(1500);
  EXPECT_EQ(h.send({.kind = CommandKind::Haptic}, 1), ReplyCode::NoSession);
  h.send({.kind = CommandKind::Home}, 100);
  h.send({.kind = CommandKind::Tare}, 300);
  h.send({.kind = CommandKind::Arm}, 300);
  EXPECT_EQ(h.send({.kind = CommandKind::Haptic}, 1), ReplyCode::NoModel);
  EXPECT_EQ(h.sample().mode, Mode::Armed);
  EXPECT_TRUE(std::isnan(h.sample().handle_wrench[0]));
  h.needle().offer(&h.image());
  EXPECT_EQ(h.send({.kind = CommandKind::Haptic}, 1), ReplyCode::Done);
  EXPECT_EQ(h.sample().mode, Mode::Haptic);
  EXPECT_EQ(h.send({.kind = CommandKind::Move, .target_pose = h.sample().pose, .speed_m_s = 0.01, .angular_speed_rad_s = 1.0}, 1),
            ReplyCode::WrongMode);
  EXPECT_EQ(h.send({.kind = CommandKind::Stop}, 1), ReplyCode::Done);
  EXPECT_EQ(h.sample().mode, Mode::Ready);
}

// Deep in the tissue, with encoders so fine that their noise does not count: whatever changes, the wrench does not jump.
TEST(HapticLoop, NoChangeIsFeltAsAStep) {
  Haptics h(16'000'000);
  h.arm();
  h.take();
  h.tick(300);
  const auto step_of = [&](const Command& command, ReplyCode expected) {
    const std::array<double, 3> before = h.sample().wrench_command;
    if (h.sample().mode == Mode::Haptic) {
      EXPECT_GT(std::abs(before[1]), 0.3);
    }
    EXPECT_EQ(h.send(command, 1), expected);
    const std::array<double, 3>& after = h.sample().wrench_command;
    return std::hypot(after[0] - before[0], after[1] - before[1]);
  };
  EXPECT_LT(step_of({.kind = CommandKind::Haptic, .display = Display::FourChannel}, ReplyCode::Done), 0.05);
  Pose deep = h.sample().pose;
  deep[1] = 0.18;
  h.want({{4.0, deep}});
  h.tick(6000);
  ASSERT_EQ(h.sample().mode, Mode::Haptic);
  for (const Display display : {Display::Impedance, Display::Admittance, Display::FourChannel}) {
    EXPECT_LT(step_of({.kind = CommandKind::Haptic, .display = display}, ReplyCode::Done), 0.05) << static_cast<int>(display);
    h.tick(1000);
    ASSERT_EQ(h.sample().mode, Mode::Haptic);
  }
  // Another model of the same place: contacts and forces begin anew there.
  const model::Image other = h.image();
  h.forget();
  h.needle().offer(&other);
  h.tick(1500);
  EXPECT_EQ(h.needle().using_image(), &other);
  EXPECT_LT(h.felt().worst_step_n, 0.05);
  ASSERT_EQ(h.sample().mode, Mode::Haptic);
  EXPECT_LT(step_of({.kind = CommandKind::Hold}, ReplyCode::Done), 0.05);
  EXPECT_EQ(h.sample().mode, Mode::Hold);
  h.tick(1000);
  EXPECT_EQ(h.sample().mode, Mode::Hold);
  EXPECT_LT(step_of({.kind = CommandKind::Haptic, .display = Display::FourChannel}, ReplyCode::Done), 0.05);
  h.tick(1000);
  EXPECT_EQ(h.sample().mode, Mode::Haptic) << to_string(h.sample().fault);
}

}  // namespace
}  // namespace trocar::sim_plant
