// Haptic mode with the real programs: a compiled scene, a rig that maps it, a command that lets a hand feel it, and the whole experiment
// with a simulated person.
#include <gtest/gtest.h>

#include <signal.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "harness.hpp"
#include "host/rig/client.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

constexpr double demo_s = 60.0;

// A shared machine may starve the simulated drives for longer; that is not tested here.
std::filesystem::path haptic_rig(const Scratch& scratch) {
  return scratch.make_rig({{"missed_feedback_ticks = 20", "missed_feedback_ticks = 1000"}}, "ubc_twin_haptic");
}

// Two displays, 1.4 s each, for a person who is quick about it.
struct Quick {
  explicit Quick(const Scratch& scratch, const std::string& displays = R"(["impedance", "admittance"])") : hand(scratch / "hand.toml") {
    const std::string rig = haptic_rig(scratch).string();
    write_text(hand, shared_file("hands/person.toml", {{"take_after_s = 0.5", "take_after_s = 0.1"},
                                                       {"forward_m = 0.075", "forward_m = 0.03"},
                                                       {"push_speed_m_s = 0.025", "push_speed_m_s = 0.06"},
                                                       {"draw_speed_m_s = 0.025", "draw_speed_m_s = 0.06"},
                                                       {"rest_out_s = 1.0", "rest_out_s = 0.2"},
                                                       {"rest_in_s = 1.0", "rest_in_s = 0.2"}}));
    write_text(scratch / "haptic.toml",
               shared_file("experiments/haptic.toml", {{R"(rig = "ubc_twin_haptic")", "rig = \"" + rig + "\""},
                                                       {R"(hand = "person")", "hand = \"" + hand.string() + "\""},
                                                       {R"(["four_channel", "impedance", "admittance"])", displays},
                                                       {"display_s = 8.0", "display_s = 1.4"},
                                                       {"take_s = 1.0", "take_s = 0.2"}}));
    experiment = (scratch / "haptic.toml").string();
  }
  std::filesystem::path hand;
  std::string experiment;
};

// Greatest value of a column; NaN is none.
double greatest(const std::filesystem::path& csv, const std::string& column) {
  std::ifstream in(csv);
  std::string line, word;
  std::getline(in, line);
  std::istringstream names(line);
  std::size_t at = 0;
  while (std::getline(names, word, ',') && word != column) ++at;
  double most = -1e9;
  while (std::getline(in, line)) {
    std::istringstream row(line);
    for (std::size_t i = 0; i <= at; ++i) std::getline(row, word, ',');
    if (const double value = std::stod(word); value > most) most = value;
  }
  return most;
}

std::size_t unfinished(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) count += entry.path().extension() == ".part" ? 1U : 0U;
  return count;
}

TEST(Haptic, DemoInLockstepGivesTheSameBytesAndARecordingOfItsHandDoesThatAgain) {
  const Scratch scratch;
  const Quick quick(scratch);
  const auto demo = [&](const std::string& name, std::vector<std::string> more) {
    std::vector<std::string> arguments{"demo",   "--experiment", quick.experiment,         "--lockstep",
                                       "--json", "--out",        (scratch / name).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Program program(scratch, "trocar", arguments);
    EXPECT_EQ(program.wait(demo_s), 0) << program.errors();
    return program.out();
  };
  const std::string summary = demo("first", {});
  demo("again", {});
  demo("other", {"--seed", "2"});
  for (const char* name : {"samples.csv", "truth.csv"}) {
    const std::string first = read_text(scratch / "first" / name);
    ASSERT_FALSE(first.empty());
    EXPECT_TRUE(first == read_text(scratch / "again" / name)) << name;  // not EXPECT_EQ: nobody reads megabytes
    EXPECT_FALSE(first == read_text(scratch / "other" / name)) << name;
  }
  for (const char* text : {"\"kind\": \"haptic\"", "\"display\": \"impedance\"", "\"display\": \"admittance\"", "\"unsolved_ticks\": 0"})
    EXPECT_NE(summary.find(text), std::string::npos) << text << summary;
  EXPECT_EQ(summary.find("\"observer_error\": {\"ticks\": 0"), std::string::npos) << summary;
  const std::string report = read_text(scratch / "first/report.html");
  EXPECT_NE(report.find("hand, true"), std::string::npos);
  EXPECT_NE(report.find("</html>"), std::string::npos);
  EXPECT_EQ(unfinished(scratch.folder()), 0U);
  // The needle went in, and the hand felt it.
  const double pushed = greatest(scratch / "first/truth.csv", "hand_fy_n");
  EXPECT_GT(pushed, 0.3);
  EXPECT_GT(greatest(scratch / "first/samples.csv", "virtual_contacts"), 1.0);

  write_text(scratch / "replay.toml",
             "take_after_s = 0.1\nreplay = \"first/truth.csv\"\n[arm]\nstiffness_n_per_m = 200.0\n"
             "damping_n_s_per_m = 10.0\nstiffness_nm_per_rad = 0.3\ndamping_nm_s_per_rad = 0.01\n");
  demo("replayed", {"--hand", (scratch / "replay.toml").string()});
  EXPECT_NEAR(greatest(scratch / "replayed/truth.csv", "hand_fy_n"), pushed, 0.1);
  EXPECT_NEAR(greatest(scratch / "replayed/truth.csv", "y_m"), greatest(scratch / "first/truth.csv", "y_m"), 1e-3);
}

TEST(Haptic, DemoWithItsProcessesLeavesAReport) {
  const Scratch scratch;
  const Quick quick(scratch, R"(["four_channel"])");
  Program program(
      scratch, "trocar",
      {"demo", "--experiment", quick.experiment, "--domain", std::to_string(own_domain()), "--json", "--out", (scratch / "run").string()});
  ASSERT_EQ(program.wait(demo_s), 0) << program.errors();
  EXPECT_TRUE(processes_mentioning(scratch.folder().string()).empty());
  for (const char* name : {"report.html", "samples.csv", "capture.mcap", "run.toml", "model.image", "figures/felt_time.svg",
                           "figures/felt_depth.svg", "figures/display_energy.svg", "figures/tick_time.svg", "figures/wakeup.svg"})
    EXPECT_TRUE(std::filesystem::exists(scratch / "run" / name)) << name;
  EXPECT_NE(program.out().find("\"display\": \"four_channel\""), std::string::npos) << program.out();
  EXPECT_GT(greatest(scratch / "run/samples.csv", "virtual_contacts"), 1.0);
  EXPECT_EQ(unfinished(scratch.folder()), 0U);
}

TEST(Haptic, BadHandIsRefusedAndNothingStays) {
  const Scratch scratch;
  const Quick quick(scratch);
  write_text(quick.hand, shared_file("hands/person.toml", {{"mass_kg = 1.0", "mass_kg = 0.0"}}));
  const std::string out = (scratch / "out").string(), rig = (scratch / "rig.toml").string(), domain = std::to_string(own_domain());
  const Words words{quick.hand.string() + ":", "mass_kg", "such as 1.0"};
  expect_refusal(scratch, "trocar-plant", {"--rig", rig, "--no-tissue", "--hand", quick.hand.string()}, words);
  expect_refusal(scratch, "trocar-bench", {"--experiment", quick.experiment, "--out", out}, words);
  EXPECT_FALSE(std::filesystem::exists(out));
  expect_refusal(scratch, "trocar", {"demo", "--experiment", quick.experiment, "--domain", domain, "--out", out}, words);
  EXPECT_FALSE(std::filesystem::exists(out));
  expect_refusal(scratch, "trocar", {"demo", "--experiment", quick.experiment, "--speeds", "9", "--out", out},
                 {"--speeds", "leave it out"});
  expect_refusal(scratch, "trocar-plant", {"--rig", rig, "--hand", "persom"}, {"persom", "did you mean person?"});
  Program both(scratch, "trocar", {"demo", "--haptic", "--experiment", quick.experiment});
  EXPECT_EQ(both.wait(answer_s), 2);
  EXPECT_TRUE(processes_mentioning(out).empty());
}

TEST(Haptic, ARigThatIsNoHapticDeviceIsRefused) {
  const Scratch scratch;
  const auto rig = scratch.make_rig();
  const auto experiment = scratch / "haptic.toml";
  const std::string out = (scratch / "out").string();
  write_text(experiment, shared_file("experiments/haptic.toml", {{R"(rig = "ubc_twin_haptic")", "rig = \"" + rig.string() + "\""}}));
  const Words words{rig.string() + ":", "no haptic device", "take ubc_twin_haptic"};
  expect_refusal(scratch, "trocar-bench", {"--experiment", experiment.string(), "--out", out}, words);
  expect_refusal(scratch, "trocar", {"demo", "--experiment", experiment.string(), "--out", out}, words);
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(Haptic, ACompiledSceneIsFeltUntilCtrlC) {
  const Scratch scratch;
  const std::string domain = std::to_string(own_domain());
  const auto image = scratch / "phantom.image";
  Program compile(scratch, "trocar", {"scene", "compile", "phantom", "--out", image.string()});
  ASSERT_EQ(compile.wait(answer_s), 0) << compile.errors();
  const std::string rig_file = haptic_rig(scratch).string();
  Program plant(scratch, "trocar-plant", {"--rig", rig_file, "--plant", "ubc_twin_haptic", "--no-tissue"});
  ASSERT_TRUE(plant.wait_for("before no tissue", answer_s)) << plant.errors();
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort", "--model", image.string()});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();

  host::RigClient client(own_domain());
  (void)client.wait_for_rig(answer_s);
  const double end = steady_s() + answer_s;
  while (client.ask(CommandKind::Home, 5.0).reply.code != ReplyCode::Done) ASSERT_LT(steady_s(), end);
  Program feel(scratch, "trocar", {"rig", "haptic", "--domain", domain, "--display", "impedance"});
  ASSERT_TRUE(feel.wait_for("the handle is the virtual needle's (impedance)", answer_s)) << feel.errors();
  Sample seen;
  while (!(seen.mode == Mode::Haptic) && steady_s() < end) client.poll(0.01, {.sample = [&](const Sample& s) { seen = s; }});
  ASSERT_EQ(seen.mode, Mode::Haptic) << to_string(seen.fault);
  EXPECT_TRUE(std::isfinite(seen.handle_wrench[1]));
  EXPECT_NEAR(seen.virtual_pose[0], seen.pose[0], 0.02);

  // Another model while it is felt; then a damaged one, which is refused.
  Program other(scratch, "trocar", {"scene", "compile", "layered", "--out", image.string()});
  ASSERT_EQ(other.wait(answer_s), 0) << other.errors();
  EXPECT_TRUE(rig.wait_for("model " + image.string() + " taken", answer_s)) << rig.errors();
  write_text(image, "this is no image");
  EXPECT_TRUE(rig.wait_for("the model that runs stays", answer_s)) << rig.errors();
  for (int i = 0; i < 20; ++i) client.poll(0.01, {.sample = [&](const Sample& s) { seen = s; }});
  EXPECT_EQ(seen.mode, Mode::Haptic) << to_string(seen.fault);
  feel.signal(SIGINT);
  EXPECT_EQ(feel.wait(answer_s), 0) << feel.errors();
}

TEST(Haptic, IsRefusedWithoutAModelAndWithADamagedOne) {
  const Scratch scratch;
  const std::string domain = std::to_string(own_domain());
  const std::string rig_file = haptic_rig(scratch).string();
  const auto damaged = scratch / "damaged.image";
  std::ofstream(damaged) << "this is no image";
  expect_refusal(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort", "--model", damaged.string()},
                 {"damaged.image"});
  Program plant(scratch, "trocar-plant", {"--rig", rig_file, "--plant", "ubc_twin_haptic", "--no-tissue"});
  ASSERT_TRUE(plant.wait_for("before no tissue", answer_s)) << plant.errors();
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort"});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();
  host::RigClient client(own_domain());
  (void)client.wait_for_rig(answer_s);
  const double end = steady_s() + answer_s;
  while (client.ask(CommandKind::Home, 5.0).reply.code != ReplyCode::Done) ASSERT_LT(steady_s(), end);
  expect_refusal(scratch, "trocar", {"rig", "haptic", "--domain", domain}, {"refused Haptic", "--model IMAGE"});
  const auto experiment = scratch / "haptic.toml";
  write_text(experiment, shared_file("experiments/haptic.toml", {{R"(rig = "ubc_twin_haptic")", "rig = \"" + rig_file + "\""}}));
  Program run(scratch, "trocar", {"experiment", "run", experiment.string(), "--domain", domain, "--out", (scratch / "run").string()});
  EXPECT_EQ(run.wait(answer_s), 1);
  EXPECT_NE(
      run.errors().find("four_channel: the rig refused Haptic: NoModel (mode Armed): no virtual needle: start trocar-rig with --model"),
      std::string::npos)
      << run.errors();
}

}  // namespace
}  // namespace trocar::testing
