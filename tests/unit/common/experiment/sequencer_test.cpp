// The haptic course against a rig that answers by the book, and by it not. (The insertion course runs in tests/integration.)
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/config/rig_file.hpp"
#include "common/experiment/experiment.hpp"
#include "common/experiment/experiment_file.hpp"

namespace trocar::experiment {
namespace {

constexpr std::uint64_t session = 7;

// Answers each command in the tick after it came, at a millisecond a tick.
struct Rig {
  explicit Rig(const HapticCourse& course) {
    Experiment e;
    e.course = course;
    sequencer.emplace(e, Placement{0.215, 0.0, 0.1}, data, session);
    sample.mode = Mode::Ready;
    sample.pose.fill(std::nan(""));  // not homed
  }
  void tick() {
    const auto command = sequencer->next();
    sample.time_ns += 1'000'000;
    ++sample.tick;
    Reply reply{session, 0, {}, ReplyCode::Done, {}, sample.tick};
    if (command) {
      sent.push_back(*command);
      if (command->kind == CommandKind::Home) sample.pose = {0.0, 0.11, 1.5707963267948966};
      if (command->kind == CommandKind::Arm) sample.mode = Mode::Armed;
      if (command->kind == CommandKind::Haptic && haptic_answer == ReplyCode::Done) sample.mode = Mode::Haptic;
      if (command->kind == CommandKind::Disarm) sample.mode = Mode::Ready;
      if (command->kind == CommandKind::Haptic) reply.code = haptic_answer;
      reply.id = command->id;
      reply.kind = command->kind;
      reply.mode = sample.mode;
    }
    if (reply_overtakes && command) sequencer->on_reply(reply);
    if (!reply_overtakes || !command) sequencer->on_sample(sample);
    if (!reply_overtakes && command) sequencer->on_reply(reply);
  }
  void run(int most) {
    for (int i = 0; i < most && !sequencer->finished(); ++i) tick();
  }

  rig::Rig data = config::read_rig(std::filesystem::path(TROCAR_SHARE) / "rigs/ubc_twin_haptic.toml");
  std::optional<Sequencer> sequencer;
  Sample sample;
  std::vector<Command> sent;
  ReplyCode haptic_answer = ReplyCode::Done;
  bool reply_overtakes{};
};

const HapticCourse two{{Display::Impedance, Display::FourChannel}, 0.5, 0.1};

TEST(HapticCourse, GivesEachDisplayItsTimeAndDisarms) {
  Rig rig(two);
  rig.run(5000);
  ASSERT_TRUE(rig.sequencer->finished());
  EXPECT_EQ(rig.sequencer->failure(), "");
  std::vector<CommandKind> kinds;
  for (const Command& c : rig.sent) kinds.push_back(c.kind);
  EXPECT_EQ(kinds, (std::vector{CommandKind::Home, CommandKind::Tare, CommandKind::Arm, CommandKind::Haptic, CommandKind::Haptic,
                                CommandKind::Disarm}));
  EXPECT_EQ(rig.sent[3].display, Display::Impedance);
  EXPECT_EQ(rig.sent[4].display, Display::FourChannel);
  std::vector<Phase> felt;
  for (const Phase& p : rig.sequencer->phases())
    if (p.kind == PhaseKind::Haptic) felt.push_back(p);
  ASSERT_EQ(felt.size(), 2U);
  for (const Phase& p : felt) EXPECT_EQ(p.last_tick - p.first_tick, 500U) << p.name;
  EXPECT_EQ(felt[0].name, "impedance");
  EXPECT_EQ(felt[0].display, Display::Impedance);
  EXPECT_GT(felt[1].first_tick, felt[0].last_tick);
  EXPECT_EQ(rig.sequencer->progress(), 1.0);
}

// A second run finds the handle where the first one left it, not in its jig.
TEST(HapticCourse, DoesNotHomeARigThatIsHomed) {
  Rig rig(two);
  rig.sample.pose = {0.01, 0.15, 1.5};
  rig.run(5000);
  EXPECT_EQ(rig.sequencer->failure(), "");
  EXPECT_TRUE(rig.sequencer->finished());
  EXPECT_EQ(rig.sequencer->progress(), 1.0);
  ASSERT_FALSE(rig.sent.empty());
  EXPECT_EQ(rig.sent.front().kind, CommandKind::Tare);
}

TEST(HapticCourse, LeavesTimeToTakeTheHandle) {
  Rig rig({{Display::Admittance}, 0.2, 3.0});
  rig.run(10000);
  ASSERT_EQ(rig.sequencer->failure(), "");
  for (const Phase& p : rig.sequencer->phases())
    if (p.name == "take the handle") {
      EXPECT_EQ(p.last_tick - p.first_tick, 3000U);
      EXPECT_EQ(p.kind, PhaseKind::Prepare);
      return;
    }
  FAIL() << "no such phase";
}

TEST(HapticCourse, FailsWhenTheRigHasNoModel) {
  Rig rig(two);
  rig.haptic_answer = ReplyCode::NoModel;
  rig.run(5000);
  ASSERT_TRUE(rig.sequencer->failed());
  EXPECT_EQ(rig.sequencer->failure(), "impedance: the rig refused Haptic: NoModel (mode Armed)");
}

TEST(HapticCourse, FailsWhenTheRigLeavesHapticByItself) {
  Rig rig(two);
  while (rig.sample.mode != Mode::Haptic) rig.tick();
  for (int i = 0; i < 10; ++i) rig.tick();
  rig.sample.mode = Mode::Hold;
  rig.run(10);
  EXPECT_EQ(rig.sequencer->failure(), "impedance: the rig left Haptic for Hold");
}

// Over DDS a reply comes before the samples of its time.
TEST(HapticCourse, ToleratesSamplesFromBeforeTheChange) {
  Rig rig({{Display::Impedance}, 0.5, 0.1});
  rig.reply_overtakes = true;
  while (rig.sent.empty() || rig.sent.back().kind != CommandKind::Haptic) rig.tick();
  Sample late = rig.sample;
  late.mode = Mode::Armed;
  late.tick -= 3;
  rig.sequencer->on_sample(late);
  rig.run(5000);
  EXPECT_EQ(rig.sequencer->failure(), "");
  EXPECT_TRUE(rig.sequencer->finished());
}

TEST(HapticCourse, AsksAgainWhileTheHandleIsNotAtRest) {
  Rig rig(two);
  rig.haptic_answer = ReplyCode::NotAtRest;
  while (rig.sent.empty() || rig.sent.back().kind != CommandKind::Haptic) rig.tick();
  rig.haptic_answer = ReplyCode::Done;
  rig.run(5000);
  EXPECT_EQ(rig.sequencer->failure(), "");
  EXPECT_TRUE(rig.sequencer->finished());
}

TEST(Sequencer, DepthAndForceAreThoseOfTheVirtualNeedleInHaptic) {
  Rig rig(two);
  Sample s;
  s.pose = {0.0, 0.120, 1.5707963267948966};
  s.base_wrench = {0.0, 0.5, 0.0};
  s.virtual_pose = {0.0, 0.135, 1.5707963267948966};
  s.virtual_wrench = {0.0, 1.25, 0.0};
  s.mode = Mode::Position;
  EXPECT_NEAR(rig.sequencer->tip_depth_m(s), 0.005, 1e-12);
  EXPECT_NEAR(rig.sequencer->axial_force_n(s), 0.5, 1e-12);
  s.mode = Mode::Haptic;
  EXPECT_NEAR(rig.sequencer->tip_depth_m(s), 0.020, 1e-12);
  EXPECT_NEAR(rig.sequencer->axial_force_n(s), 1.25, 1e-12);
}

}  // namespace
}  // namespace trocar::experiment
