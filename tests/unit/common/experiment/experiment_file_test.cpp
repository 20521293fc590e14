#include "common/experiment/experiment_file.hpp"

#include <iterator>

#include "file_fixture.hpp"

namespace trocar::experiment {
namespace {

using config::testing::edited;
using config::testing::expect_parts;

class ExperimentFile : public config::testing::FileFixture {
 protected:
  static std::string shipped(const char* name) {
    std::ifstream file(std::filesystem::path(TROCAR_SHARE) / "experiments" / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void expect_refusal(const char* name, const char* from, const char* to, std::initializer_list<std::string> parts) {
    const auto edit = edited(shipped(name), from, to);
    const std::string message = error_of(edit.text, [](const auto& file) { return read_experiment(file); });
    expect_parts(message, {edit.line});
    expect_parts(message, parts);
  }
};

TEST_F(ExperimentFile, ReadsBothKinds) {
  const Experiment haptic = read_experiment(write(shipped("haptic.toml")));
  ASSERT_TRUE(haptic.haptic());
  EXPECT_EQ(haptic.hand, "person");
  EXPECT_EQ(std::get<HapticCourse>(haptic.course).displays, (std::vector{Display::FourChannel, Display::Impedance, Display::Admittance}));
  EXPECT_EQ(std::get<HapticCourse>(haptic.course).display_s, 8.0);
  const std::string text = shipped("insertion.toml");
  const Experiment insertion = read_experiment(write(text));
  ASSERT_FALSE(insertion.haptic());
  EXPECT_EQ(std::get<InsertionCourse>(insertion.course).speeds_m_s.size(), 3U);
  EXPECT_EQ(insertion.hand, "");
  // Files from before there were two kinds.
  EXPECT_FALSE(read_experiment(write(edited(text, "kind = \"insertion\"\n", "").text)).haptic());
}

TEST_F(ExperimentFile, RefusesKeysOfTheOtherKindByName) {
  expect_refusal("haptic.toml", "take_s = 1.0", "depth_m = 0.07\ntake_s = 1.0", {"depth_m", "other kind", "kind = \"insertion\""});
  expect_refusal("insertion.toml", "dwell_s = 0.5", "display_s = 0.5", {"display_s", "other kind", "kind = \"haptic\""});
  expect_refusal("insertion.toml", "dwell_s = 0.5", "hand = \"person\"\ndwell_s = 0.5", {"hand", "other kind", "kind = \"haptic\""});
}

TEST_F(ExperimentFile, SaysWhatIsWrongInAHapticOne) {
  expect_refusal("haptic.toml", "kind = \"haptic\"", "kind = \"hapitc\"", {"hapitc", "insertion", "haptic"});
  expect_refusal("haptic.toml", "\"impedance\"", "\"impedence\"", {"impedence", "four_channel", "impedance", "admittance"});
  expect_refusal("haptic.toml", "display_s = 8.0", "display_s = -8.0", {"display_s", "-8"});
  expect_refusal("haptic.toml", "take_s = 1.0", "take_s = \"soon\"", {"take_s", "soon"});
  const auto without_hand = edited(shipped("haptic.toml"), "hand = \"person\" ", "#");
  expect_parts(error_of(without_hand.text, [](const auto& file) { return read_experiment(file); }), {"file.toml:", "hand", "share/hands"});
}

TEST_F(ExperimentFile, CommandLinesReplaceOnlyWhatTheKindHas) {
  Experiment haptic = read_experiment(write(shipped("haptic.toml")));
  Experiment insertion = read_experiment(write(shipped("insertion.toml")));
  replace(haptic, {}, "other");
  replace(insertion, {0.004}, "");
  EXPECT_EQ(haptic.hand, "other");
  EXPECT_EQ(std::get<InsertionCourse>(insertion.course).speeds_m_s, std::vector{0.004});
  expect_parts(error_from([&] { replace(haptic, {0.004}, ""); }), {"--speeds", "haptic", "leave it out"});
  expect_parts(error_from([&] { replace(insertion, {}, "person"); }), {"--hand", "insertion", "leave it out"});
}

TEST_F(ExperimentFile, RunComesBackAsItWasWritten) {
  experiment::Run run;
  run.experiment = "a \"quoted\" name";
  run.haptic = true;
  run.rig = "r";
  run.scene = "s";
  run.placement = {0.215, 0.001, 0.1};
  run.completed = true;
  run.phases = {{"arm", PhaseKind::Prepare, 0.0, "default", 3, 9, {}},
                {"admittance", PhaseKind::Haptic, 0.0, "default", 10, 20, Display::Admittance}};
  write_run(folder_, run);
  const experiment::Run back = read_run(folder_);
  EXPECT_TRUE(back.haptic);
  EXPECT_EQ(back.experiment, run.experiment);
  ASSERT_EQ(back.phases.size(), 2U);
  EXPECT_EQ(back.phases[1].kind, PhaseKind::Haptic);
  EXPECT_EQ(back.phases[1].display, Display::Admittance);
  EXPECT_EQ(back.phases[1].last_tick, 20U);
  run.haptic = false;
  write_run(folder_, run);
  EXPECT_FALSE(read_run(folder_).haptic);
}

}  // namespace
}  // namespace trocar::experiment
