// The fault matrix: everything around the controller that may fail, each in a moving machine in lock-step, on the real protocol. For each
// row the first cause is latched and named, the reaction is the table's, and the time to it and to the safe state is counted in ticks; what
// is below a limit is borne. README.md of firmware/safety shows these rows with their counts: the test says so when it does not.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "common/config/rig_file.hpp"
#include "common/scene/scene.hpp"
#include "firmware/safety/faults.hpp"
#include "hal/canopen/objects.hpp"
#include "readme_table.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace trocar::sim_plant {
namespace {

using safety::Reaction;

constexpr std::uint64_t host = 1;
constexpr std::uint32_t whole_id = 0x7FF;
constexpr std::int64_t ms = 1'000'000;

// The machine moves aside at 20 mm/s, in the air; a second later something happens.
class Moving {
 public:
  Moving() : bench_(rig_, read_plant(share_ / "plants/ubc_twin.toml"), std::nullopt, 1) {
    tick(1500);
    send({.kind = CommandKind::Home}, 100);
    send({.kind = CommandKind::Tare}, 300);
    send({.kind = CommandKind::Arm}, 300);
    const auto from = sample().pose;
    send({.kind = CommandKind::Move, .target_pose = {-0.03, from[1] + 0.02, from[2]}, .speed_m_s = 0.05, .angular_speed_rad_s = 1.0}, 1500);
    send({.kind = CommandKind::Move, .target_pose = {0.04, from[1] + 0.02, from[2]}, .speed_m_s = 0.02, .angular_speed_rad_s = 1.0}, 1000);
  }

  void tick(int n = 1) {
    for (int i = 0; i < n; ++i) {
      if (host_talks) bench_.mail().commands.push({.session = host, .kind = CommandKind::KeepAlive});
      bench_.tick();
      ++ticks_;
      Reply r;
      while (bench_.mail().replies.pop(r)) replies_.push_back(r);
      Event e;
      while (bench_.mail().events.pop(e))
        if (e.kind == EventKind::FaultLatched) latched_.push_back(e);
      Sample s;
      bench_.mail().samples.push(sample());
      while (bench_.mail().samples.pop(s)) {
        EXPECT_TRUE(last_tick_ == 0 || s.tick == last_tick_ + 1);
        last_tick_ = s.tick;
      }
    }
  }
  ReplyCode send(Command c, int ticks = 1) {
    c.session = c.session == 0 ? host : c.session;
    c.id = ++id_;
    bench_.mail().commands.push(c);
    tick(ticks);
    for (auto r = replies_.rbegin(); r != replies_.rend(); ++r)
      if (r->id == id_) return r->code;
    return ReplyCode::WrongVersion;
  }
  void happen(Trouble t, double for_ms = 1e9) {
    t.from_ns = bench_.now_ns();
    t.to_ns = for_ms < 1e9 ? bench_.now_ns() + static_cast<std::int64_t>(for_ms * ms) : t.to_ns;
    bench_.faults().add(t);
  }

  // A hand leans on the handle with 4 N.
  void lean() {
    const double now_s = 1e-9 * static_cast<double>(bench_.now_ns());
    hand_.replay({{now_s, {}}, {now_s + 0.5, {0.0, -4.0, 0.0}}, {1e6, {0.0, -4.0, 0.0}}});
    bench_.plant().give_to(&hand_);
    tick(1000);
  }

  [[nodiscard]] const Sample& sample() { return bench_.sample(); }
  [[nodiscard]] Bench& bench() { return bench_; }
  [[nodiscard]] const rig::Rig& rig() const { return rig_; }
  [[nodiscard]] const std::vector<Event>& latched() const { return latched_; }
  [[nodiscard]] std::uint32_t node(std::size_t drive) const { return rig_.buses.drive_node[drive]; }
  [[nodiscard]] bool torque_off() const {
    for (std::size_t i = 0; i < WiredPlant::drives; ++i)
      if (plant().drive(i).motor_torque_nm() != 0.0) return false;
    return true;
  }
  // At rest it flickers by a count or two of the encoders, at up to 3 mm/s.
  [[nodiscard]] bool still() const { return std::hypot(plant().physics().velocity()[0], plant().physics().velocity()[1]) < 5e-3; }

  bool host_talks = true;

 private:
  [[nodiscard]] const WiredPlant& plant() const { return const_cast<Bench&>(bench_).plant(); }

  std::filesystem::path share_{TROCAR_SHARE};
  rig::Rig rig_ = config::read_rig(share_ / "rigs/ubc_twin.toml");
  Bench bench_;
  Hand hand_{HandConfig{}, Hand::Vector3{}};
  std::uint32_t id_{};
  std::uint64_t ticks_{}, last_tick_{};
  std::vector<Reply> replies_;
  std::vector<Event> latched_;
};

enum class Seen : std::uint8_t {
  AtOnce,     // after the fault's own patience
  ByMotion,   // it takes a motion to show
  ByDrives,   // the drives' own watchdogs end it, and tell
  ByBusLoss,  // and no frame reaches the drives any more: their watchdogs take the torque away
  Nowhere,    // and nothing reaches anything: only the command can be looked at
};

struct Row {
  const char* what;
  Fault fault;  // None: borne
  Seen seen;
  std::function<void(Moving&)> happens;
};

Trouble frames(Ailment ailment, Wire wire, std::uint32_t id, double amount = 0.0) {
  return {.ailment = ailment, .wire = wire, .id = id, .mask = whole_id, .amount = amount};
}

Trouble to_drives(std::uint32_t id) {
  return {.ailment = Ailment::Lost, .wire = Wire::Drives, .way = Way::ToPlant, .id = id, .mask = whole_id};
}

std::vector<Row> rows() {
  namespace co = hal::canopen;
  std::vector<Row> all;
  const auto add = [&](const char* what, Fault fault, std::function<void(Moving&)> happens, Seen seen = Seen::AtOnce) {
    all.push_back({what, fault, seen, std::move(happens)});
  };
  const auto feedback = [](Moving& m, std::size_t drive, Ailment ailment, double for_ms, double amount = 0.0) {
    m.happen(frames(ailment, Wire::Drives, co::cob_feedback(static_cast<std::uint8_t>(m.node(drive))), amount), for_ms);
  };
  const auto part = [](Moving& m, Ailment ailment, std::size_t drive, double amount = 0.0) {
    m.happen({.ailment = ailment, .drive = drive, .amount = amount});
  };
  const auto heartbeat = [](Moving& m, std::size_t drive, int lost) {
    m.happen(frames(Ailment::Lost, Wire::Drives, co::cob_heartbeat(static_cast<std::uint8_t>(m.node(drive)))), 20.0 * lost);
  };

  add("one heartbeat of a drive lost", Fault::None, [=](Moving& m) { heartbeat(m, 0, 1); });
  add("two heartbeats of a drive lost", Fault::None, [=](Moving& m) { heartbeat(m, 1, 2); });
  add("three heartbeats of drive 1 lost", Fault::HeartbeatLost, [=](Moving& m) { heartbeat(m, 0, 3); });
  add("three heartbeats of drive 2 lost", Fault::HeartbeatLost, [=](Moving& m) { heartbeat(m, 1, 3); });
  add("three heartbeats of drive 3 lost", Fault::HeartbeatLost, [=](Moving& m) { heartbeat(m, 2, 3); });
  add("three heartbeats of drive 4 lost", Fault::HeartbeatLost, [=](Moving& m) { heartbeat(m, 3, 3); });
  add("heartbeats of a drive lost for good", Fault::HeartbeatLost, [=](Moving& m) { heartbeat(m, 2, 1000); });
  add(
      "the controller's own heartbeat lost", Fault::DriveFault,
      [](Moving& m) { m.happen(to_drives(co::cob_heartbeat(m.rig().buses.master_node))); }, Seen::ByDrives);

  add("one feedback frame lost", Fault::None, [=](Moving& m) { feedback(m, 0, Ailment::Lost, 1); });
  add("19 feedback frames of a drive lost", Fault::None, [=](Moving& m) { feedback(m, 1, Ailment::Lost, 19); });
  add("20 feedback frames of a drive lost", Fault::None, [=](Moving& m) { feedback(m, 2, Ailment::Lost, 20); });
  add("21 feedback frames of a drive lost", Fault::FeedbackLost, [=](Moving& m) { feedback(m, 3, Ailment::Lost, 21); });
  add("one feedback frame 0.6 ms late", Fault::None, [=](Moving& m) { feedback(m, 0, Ailment::Late, 1, 0.6e-3); });
  add("20 feedback frames 0.6 ms late", Fault::None, [=](Moving& m) { feedback(m, 0, Ailment::Late, 20, 0.6e-3); });
  add("21 feedback frames 0.6 ms late", Fault::FeedbackLost, [=](Moving& m) { feedback(m, 0, Ailment::Late, 21, 0.6e-3); });
  add("feedback frames twice", Fault::None, [=](Moving& m) { feedback(m, 1, Ailment::Twice, 500); });
  add("feedback frames out of order", Fault::None, [=](Moving& m) { feedback(m, 1, Ailment::OutOfOrder, 500); });
  add("one feedback frame short", Fault::None, [=](Moving& m) { feedback(m, 2, Ailment::Shortened, 1); });
  add("feedback frames short", Fault::FeedbackLost, [=](Moving& m) { feedback(m, 2, Ailment::Shortened, 1e9); });
  add("a bit of one position flipped", Fault::EncoderJump, [=](Moving& m) { feedback(m, 2, Ailment::Flipped, 1, 14); });
  add(
      "SYNC lost on the bus", Fault::FeedbackLost, [](Moving& m) { m.happen(to_drives(co::cob_sync)); }, Seen::ByBusLoss);
  add(
      "torque frames lost on the bus", Fault::DriveFault, [](Moving& m) { m.happen(to_drives(co::cob_torque)); }, Seen::ByDrives);
  add("one torque frame lost", Fault::None, [](Moving& m) { m.happen(to_drives(co::cob_torque), 1); });
  add(
      "a node that babbles", Fault::FeedbackLost,
      [](Moving& m) { m.happen({.ailment = Ailment::Babbled, .wire = Wire::Drives, .amount = 8.0}); }, Seen::ByBusLoss);
  add(
      "the CAN controller off the bus", Fault::BusOff, [=](Moving& m) { part(m, Ailment::BusOff, 0); }, Seen::ByBusLoss);

  add("an emergency message (2310h)", Fault::DriveFault, [=](Moving& m) { part(m, Ailment::Emergency, 1, 0x2310); });
  add("a drive that faults (3210h)", Fault::DriveFault, [=](Moving& m) { part(m, Ailment::DriveFault, 2, 0x3210); });
  add("a drive that leaves operation", Fault::DriveFault, [=](Moving& m) { part(m, Ailment::LeftOperation, 3); });
  add("a drive's power gone and back", Fault::DriveFault, [=](Moving& m) { part(m, Ailment::PowerCut, 0); });
  add("a motor without torque, under load", Fault::TorqueMismatch, [=](Moving& m) {
    m.lean();
    part(m, Ailment::MotorDead, 1);
  });
  add(
      "a motor at its peak", Fault::VelocityLimit, [=](Moving& m) { part(m, Ailment::MotorFull, 1); }, Seen::ByMotion);
  add(
      "an encoder that stands", Fault::Inconsistent, [=](Moving& m) { part(m, Ailment::EncoderStuck, 0); }, Seen::ByMotion);
  add("an encoder that jumps by 5 degrees", Fault::EncoderJump, [=](Moving& m) { part(m, Ailment::EncoderJumped, 1, 0.0873); });
  add(
      "an encoder that counts backwards", Fault::Inconsistent, [=](Moving& m) { part(m, Ailment::EncoderBackwards, 2); }, Seen::ByMotion);

  add("force sensor silent for 50 ms", Fault::None, [](Moving& m) { m.happen({.ailment = Ailment::Lost, .wire = Wire::Sensor}, 50); });
  add("force sensor silent", Fault::SensorLost, [](Moving& m) { m.happen({.ailment = Ailment::Lost, .wire = Wire::Sensor}); });
  add("force sensor saturated", Fault::SensorSaturated, [=](Moving& m) { part(m, Ailment::SensorSaturated, 0); });
  add(
      "the plant stands still", Fault::FeedbackLost, [=](Moving& m) { part(m, Ailment::Frozen, 0); }, Seen::Nowhere);
  return all;
}

// Runs a row and holds it to its promise; returns the row as the README shows it.
std::string judge(const Row& row) {
  SCOPED_TRACE(row.what);
  Moving m;
  EXPECT_EQ(m.sample().mode, Mode::Position) << to_string(m.sample().fault);
  EXPECT_EQ(m.sample().moving, 1);
  row.happens(m);
  int latched = 0;
  while (latched < 1000 && m.sample().mode != Mode::Fault) {
    m.tick();
    ++latched;
  }
  std::ostringstream text;
  if (row.fault == Fault::None) {
    EXPECT_EQ(m.sample().mode, Mode::Position) << to_string(m.sample().fault);
    m.tick(3000);
    EXPECT_EQ(m.sample().mode, Mode::Position) << to_string(m.sample().fault);
    EXPECT_EQ(m.sample().moving, 0);  // and the motion came to its end
    text << "| " << row.what << " | borne | | | |\n";
    return text.str();
  }
  EXPECT_EQ(m.sample().mode, Mode::Fault);
  EXPECT_EQ(m.sample().fault, row.fault) << to_string(m.sample().fault);
  const Reaction reaction = safety::row(row.fault).reaction;
  // One tick for what happens between two of them, one for the frame that tells it.
  const auto watchdog = std::max<std::uint32_t>(hal::canopen::rpdo_timeout_ms(m.rig()), m.rig().timing.heartbeat_timeout_ms);
  const auto patience = row.seen == Seen::ByDrives ? watchdog : safety::patience_ticks(row.fault, m.rig());
  if (row.seen != Seen::ByMotion) {
    EXPECT_LE(latched, static_cast<int>(patience) + 2);
  }
  int safe = 0;
  const int allowed =
      row.seen == Seen::ByBusLoss ? hal::canopen::rpdo_timeout_ms(m.rig()) + 1 : static_cast<int>(safety::settle_ticks(reaction, m.rig()));
  const auto is_safe = [&] {
    if (row.seen == Seen::Nowhere) return m.sample().joint_torque_command_nm == std::array<double, 4>{};
    return reaction == Reaction::Hold ? m.still() && m.sample().moving == 0 : m.torque_off();
  };
  while (!is_safe() && safe < 10 * allowed) {
    m.tick();
    ++safe;
  }
  EXPECT_LE(safe, allowed);
  // It stays, whatever follows, until somebody resets it.
  m.tick(300);
  EXPECT_TRUE(is_safe());
  m.bench().faults().clear();
  m.tick(2000);
  EXPECT_EQ(m.sample().mode, Mode::Fault);
  EXPECT_EQ(m.sample().fault, row.fault);
  EXPECT_FALSE(m.latched().empty());
  EXPECT_TRUE(m.latched().empty() || m.latched().front().fault == row.fault);
  const ReplyCode reset = m.send({.kind = CommandKind::ResetFault}, 200);
  if (row.fault == Fault::BusOff) {
    EXPECT_EQ(reset, ReplyCode::StillFaulty);
    EXPECT_EQ(m.sample().mode, Mode::Fault);
  } else {
    EXPECT_EQ(reset, ReplyCode::Done);
    EXPECT_EQ(m.sample().mode, Mode::Ready);
  }
  EXPECT_TRUE(m.torque_off());
  static constexpr const char* reactions[] = {"hold", "quick stop", "torque off"};
  text << "| " << row.what << " | " << to_string(row.fault) << " | " << reactions[static_cast<std::size_t>(reaction)] << " | " << latched
       << " | " << safe << " |\n";
  return text.str();
}

TEST(FaultMatrix, EveryRowIsNamedReactsInTimeAndIsShown) {
  std::string table = "| what happens | fault | reaction | ticks to the fault | and to the safe state |\n|---|---|---|---|---|\n";
  for (const Row& row : rows()) table += judge(row);
  trocar::testing::expect_shown("firmware/safety/README.md", "fault matrix", table);
}

}  // namespace
}  // namespace trocar::sim_plant
