// What a person can get wrong, tried on every program that it reaches: exit code 1, one message with place and remedy, nothing left behind.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <optional>

#include "harness.hpp"
#include "host/rig/client.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

std::string domain() { return std::to_string(own_domain()); }

// Nothing, or an empty folder.
bool untouched(const std::filesystem::path& out) { return !std::filesystem::exists(out) || std::filesystem::is_empty(out); }

std::string line_of(const std::filesystem::path& file, const std::string& text) {
  const std::string all = read_text(file);
  const std::size_t at = all.find(text);
  EXPECT_NE(at, std::string::npos) << text;
  return file.string() + ":" + std::to_string(1 + std::count(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

struct Mistake {
  const char* name;
  const char* right;         // what ubc_twin.toml has
  const char* wrong;         // what stands there instead
  Words words;               // what the message has to hold besides file and line
  const char* at = nullptr;  // whose line is named, if not that of `wrong`
};
void PrintTo(const Mistake& m, std::ostream* out) { *out << m.name; }

class RigFile : public ::testing::TestWithParam<Mistake> {};

TEST_P(RigFile, IsRefusedByEveryProgramThatReadsIt) {
  const Mistake& m = GetParam();
  const Scratch scratch;
  const auto rig = scratch.make_rig({{m.right, m.wrong}});
  const auto experiment = scratch.make_experiment().string();
  const auto out = scratch / "out";
  Words words = m.words;
  words.push_back(line_of(rig, m.at != nullptr ? m.at : m.wrong));
  expect_refusal(scratch, "trocar-rig", {"--rig", rig.string(), "--domain", domain(), "--best-effort"}, words);
  expect_refusal(scratch, "trocar-plant", {"--rig", rig.string()}, words);
  expect_refusal(scratch, "trocar-bench", {"--experiment", experiment, "--out", out.string()}, words);
  EXPECT_TRUE(untouched(out));
  expect_refusal(scratch, "trocar", {"rig", "info", rig.string()}, words);
  expect_refusal(scratch, "trocar", {"demo", "--experiment", experiment, "--domain", domain(), "--out", out.string()}, words);
  EXPECT_TRUE(untouched(out));
}

INSTANTIATE_TEST_SUITE_P(
    Mistakes, RigFile,
    ::testing::Values(Mistake{"Malformed", "base_m = 0.08", "base_m = = 0.08", {}},
                      Mistake{
                          "UnknownKey", "end_point_mass_kg = 0.02", "end_point_colour = 3\nend_point_mass_kg = 0.02", {"end_point_colour"}},
                      Mistake{"MisspeltKey",
                              "gear_efficiency = 0.85",
                              "gear_eficiency = 0.85",
                              {"gear_eficiency: was gear_efficiency meant?"},
                              "[actuation]"},
                      Mistake{"WrongType", "base_m = 0.08", "base_m = \"wide\"", {"base_m", "number", "wide"}},
                      Mistake{"NegativeLength", "length_m = [0.105, 0.105]", "length_m = [-0.105, 0.105]", {"length_m", "-0.105"}},
                      Mistake{"NotANumber", "base_m = 0.08", "base_m = nan", {"base_m"}},
                      Mistake{"ImpossibleGeometry", "base_m = 0.08", "base_m = 0.9", {"base_m", "cannot reach each other", "closer"}},
                      Mistake{"WrongUnit", "base_m = 0.08", "base_mm = 80", {"base_mm", "base_m = 0.08"}}),
    [](const auto& one) { return std::string(one.param.name); });

TEST(BadInput, MissingFilesAreNamed) {
  const Scratch scratch;
  const std::string rig = (scratch / "none.toml").string();
  const auto out = scratch / "out";
  expect_refusal(scratch, "trocar-rig", {"--rig", rig, "--best-effort"}, {rig, "there is no such file"});
  expect_refusal(scratch, "trocar-plant", {"--rig", rig}, {rig, "there is no such file"});
  expect_refusal(scratch, "trocar-plant", {"--scene", rig}, {rig, "there is no such file"});
  expect_refusal(scratch, "trocar-bench", {"--experiment", rig, "--out", out.string()}, {rig, "there is no such file"});
  expect_refusal(scratch, "trocar", {"rig", "info", rig}, {rig, "there is no such file"});
  expect_refusal(scratch, "trocar", {"demo", "--experiment", rig, "--out", out.string()}, {rig, "there is no such file"});
  EXPECT_TRUE(untouched(out));
  expect_refusal(scratch, "trocar", {"rig", "info", "ubc_twim"}, {"ubc_twim", "did you mean ubc_twin?"});
  expect_refusal(scratch, "trocar", {"report", out.string()}, {out.string()});
}

TEST(BadInput, MistakesInSceneAndExperimentAreRefused) {
  const Scratch scratch;
  (void)scratch.make_rig();
  const auto out = scratch / "out";
  const auto scene = scratch / "scene.toml";
  write_text(scene, shared_file("scenes/phantom.toml", {{"young_pa", "young_kpa"}}));
  expect_refusal(scratch, "trocar-plant", {"--rig", (scratch / "rig.toml").string(), "--scene", scene.string()},
                 {line_of(scene, "young_kpa"), "young_pa"});
  auto experiment = scratch.make_experiment({{"depth_m = 0.010", "depth_m = 0.2"}}).string();  // further than the rig reaches
  for (const char* how : {"bench", "demo"}) {
    const bool bench = std::string(how) == "bench";
    expect_refusal(
        scratch, bench ? "trocar-bench" : "trocar",
        bench ? Words{"--experiment", experiment, "--out", out.string()} : Words{"demo", "--experiment", experiment, "--out", out.string()},
        {"outside of the workspace", "lower depth_m"});
    EXPECT_TRUE(untouched(out));
  }
}

TEST(BadInput, SingleLinkageCannotCarryTheHandle) {
  const Scratch scratch;
  const Words twin_needed{"five_bar.toml:", "kind", "needs a twin", "take ubc_twin"};
  (void)scratch.make_rig();
  const auto out = scratch / "out";
  expect_refusal(scratch, "trocar-rig", {"--rig", "five_bar", "--domain", domain(), "--best-effort"}, twin_needed);
  expect_refusal(scratch, "trocar-plant", {"--rig", "five_bar"}, twin_needed);
  const auto experiment = scratch / "single.toml";
  write_text(experiment, shared_file("experiments/insertion.toml", {{"rig = \"ubc_twin\"", "rig = \"five_bar\""}}));
  expect_refusal(scratch, "trocar", {"demo", "--experiment", experiment.string(), "--out", out.string()}, twin_needed);
  expect_refusal(scratch, "trocar-bench", {"--experiment", experiment.string(), "--out", out.string()}, twin_needed);
  EXPECT_TRUE(untouched(out));
}

// Before the bus is opened and a model is looked for.
TEST(BadInput, ARigThatCannotBeAHapticDeviceTakesNoModel) {
  const Scratch scratch;
  const auto rig = scratch.make_rig();
  const Words start{"--rig", rig.string(), "--domain", domain(), "--best-effort", "--model", (scratch / "none.image").string()};
  expect_refusal(scratch, "trocar-rig", start, {rig.string(), "haptic", "no haptic device", "take ubc_twin_haptic"});
  write_text(rig, shared_file("rigs/ubc_twin_haptic.toml", {{"encoder_counts_per_turn = 16000", "encoder_counts_per_turn = 2000"}}));
  expect_refusal(
      scratch, "trocar-rig", start,
      {line_of(rig, "bandwidth_rad_s = 390.0"), "haptic.observer.bandwidth_rad_s = 390", "too high for the encoder", "lower it"});
}

TEST(BadInput, TakenPortIsNamed) {
  const Scratch scratch;
  const auto ports = free_udp_ports(2);
  const int taken = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(ports[0]);
  ASSERT_EQ(bind(taken, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  // The same port as the rig's end of one bus and, in a second file, as the plant's end of the other.
  const std::string port = std::to_string(ports[0]);
  const auto edit = [&](const char* key, const std::filesystem::path& from) {
    std::string text = read_text(from);
    const std::size_t at = text.find(key) + std::string(key).size();
    text.replace(at, text.find('\n', at) - at, port);
    write_text(from, text);
  };
  const auto rig = scratch.make_rig();
  edit("rig_port = ", rig);
  expect_refusal(scratch, "trocar-rig", {"--rig", rig.string(), "--domain", domain(), "--best-effort"},
                 {line_of(rig, "rig_port = " + port), "UDP port " + port, "taken", "choose another port"});
  (void)scratch.make_rig();
  edit("plant_port = ", rig);
  const Words words{line_of(rig, "plant_port = " + port), "UDP port " + port, "taken", "choose another port"};
  expect_refusal(scratch, "trocar-plant", {"--rig", rig.string()}, words);
  const auto out = scratch / "out";
  expect_refusal(scratch, "trocar",
                 {"demo", "--experiment", scratch.make_experiment().string(), "--domain", domain(), "--out", out.string()},
                 {"UDP port " + port, "taken", "choose another port"});
  EXPECT_TRUE(untouched(out));
  EXPECT_TRUE(processes_mentioning(scratch.folder().string()).empty());
  close(taken);
}

// Tests may run as root, whom no permission stops: a file stands where the folder should be.
TEST(BadInput, UnwritableFolderIsNamed) {
  const Scratch scratch;
  (void)scratch.make_rig();
  const auto experiment = scratch.make_experiment().string();
  write_text(scratch / "file", "in the way");
  const std::string out = (scratch / "file" / "run").string();
  expect_refusal(scratch, "trocar-bench", {"--experiment", experiment, "--out", out}, {out, "--out"});
  expect_refusal(scratch, "trocar", {"demo", "--experiment", experiment, "--domain", domain(), "--out", out}, {out, "--out"});
  expect_refusal(scratch, "trocar", {"record", "--domain", domain(), "--out", out}, {out, "choose a folder"});
  expect_refusal(scratch, "trocar", {"record", "--domain", domain(), "--out", out + ".mcap"}, {out + ".mcap"});
  EXPECT_EQ(read_text(scratch / "file"), "in the way");

  // Earlier results are not written over.
  const auto full = scratch / "full";
  std::filesystem::create_directory(full);
  write_text(full / "capture.mcap", "earlier");
  expect_refusal(scratch, "trocar-bench", {"--experiment", experiment, "--out", full.string()}, {full.string(), "capture.mcap"});
  expect_refusal(scratch, "trocar", {"demo", "--experiment", experiment, "--domain", domain(), "--out", full.string()},
                 {full.string(), "capture.mcap"});
  EXPECT_EQ(read_text(full / "capture.mcap"), "earlier");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(full), {}), 1);
}

TEST(BadInput, SecondCommanderIsRefused) {
  const Scratch scratch;
  const std::string rig_file = scratch.make_rig().string();
  Program plant(scratch, "trocar-plant", {"--rig", rig_file});
  ASSERT_TRUE(plant.wait_for("before scene", answer_s)) << plant.errors();
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain(), "--best-effort"});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();
  Program look(scratch, "trocar", {"rig", "status", "--domain", domain()});
  ASSERT_EQ(look.wait(answer_s), 0) << look.errors();

  host::RigClient first(own_domain());
  (void)first.wait_for_rig(answer_s);
  const double end = steady_s() + answer_s;
  while (first.ask(CommandKind::Home, 5.0).reply.code != ReplyCode::Done) ASSERT_LT(steady_s(), end);
  Program armed(scratch, "trocar", {"rig", "arm", "--domain", domain()});
  ASSERT_TRUE(armed.wait_for("armed; Ctrl-C disarms", answer_s)) << armed.errors();

  for (const CommandKind kind : {CommandKind::Arm, CommandKind::Move, CommandKind::Disarm, CommandKind::SelectGains}) {
    const auto refused = first.ask(kind, 5.0, "thesis");
    EXPECT_EQ(refused.reply.code, ReplyCode::SessionTaken) << to_string(kind);
    EXPECT_NE(refused.text.find("another commander is armed: it has to disarm"), std::string::npos) << refused.text;
  }
  expect_refusal(scratch, "trocar", {"rig", "arm", "--domain", domain()}, {"refused Arm", "another commander is armed"});
  const auto out = scratch / "out";
  expect_refusal(scratch, "trocar", {"experiment", "run", scratch.make_experiment().string(), "--domain", domain(), "--out", out.string()},
                 {"held by another commander", "trocar rig stop"});
  EXPECT_TRUE(untouched(out));
  EXPECT_TRUE(armed.running());
  armed.signal(SIGINT);
  EXPECT_EQ(armed.wait(answer_s), 0) << armed.errors();
}

TEST(BadInput, WrongUsageIsCodeTwo) {
  const Scratch scratch;
  const auto code = [&](const std::string& name, const Words& arguments) {
    Program program(scratch, name, arguments);
    const int result = program.wait(answer_s);
    EXPECT_FALSE(program.errors().empty());
    return result;
  };
  EXPECT_EQ(code("trocar", {}), 2);
  EXPECT_EQ(code("trocar", {"dance"}), 2);
  EXPECT_EQ(code("trocar", {"rig", "dance"}), 2);
  EXPECT_EQ(code("trocar", {"demo", "--dance"}), 2);
  EXPECT_EQ(code("trocar", {"demo", "--speeds", "fast"}), 2);
  EXPECT_EQ(code("trocar", {"demo", "--speeds", "-1"}), 2);
  EXPECT_EQ(code("trocar", {"rig", "status", "--domain", "300"}), 2);
  EXPECT_EQ(code("trocar", {"record"}), 2);
  EXPECT_EQ(code("trocar-bench", {}), 2);
  for (const char* name : {"trocar-rig", "trocar-plant", "trocar-bench"}) EXPECT_EQ(code(name, {"--dance"}), 2) << name;
}

}  // namespace
}  // namespace trocar::testing
