// Rig and host with keys, as over a network (here on the loopback interface): who may do what, and who is not even seen.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <optional>
#include <thread>

#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

// Set for the programs that start while it lives.
class Keys {
 public:
  explicit Keys(const std::filesystem::path& folder) { setenv("TROCAR_KEYS", folder.c_str(), 1); }
  ~Keys() { unsetenv("TROCAR_KEYS"); }
  Keys(const Keys&) = delete;
  Keys& operator=(const Keys&) = delete;
};

int make_keys(const Scratch& scratch, const std::string& name) {
  Program make(scratch, "trocar", {"keys", (scratch / name).string(), "--interface", "lo", "--peer", "127.0.0.1"});
  const int code = make.wait(answer_s);
  EXPECT_EQ(code, 0) << make.errors();
  return code;
}

TEST(Keys, HostsCommandObserversOnlyLookAndStrangersSeeNothing) {
  const Scratch scratch;
  ASSERT_EQ(make_keys(scratch, "keys"), 0);
  ASSERT_EQ(make_keys(scratch, "other"), 0);
  const std::string rig_file = scratch.make_rig().string(), domain = std::to_string(own_domain());
  Program plant(scratch, "trocar-plant", {"--rig", rig_file, "--no-tissue"});
  ASSERT_TRUE(plant.wait_for("trocar-plant", answer_s)) << plant.errors();
  std::optional<Program> rig;
  {
    const Keys as(scratch / "keys/rig");
    rig.emplace(scratch, "trocar-rig", std::vector<std::string>{"--rig", rig_file, "--domain", domain, "--best-effort"});
  }
  ASSERT_TRUE(rig->wait_for("DDS domain", answer_s)) << rig->errors();
  {
    const Keys as(scratch / "keys/host");
    Program status(scratch, "trocar", {"rig", "status", "--domain", domain});
    EXPECT_EQ(status.wait(answer_s), 0) << status.errors();
    EXPECT_TRUE(rig->running());
  }
  {
    const Keys as(scratch / "keys/observer");
    expect_refusal(scratch, "trocar", {"rig", "home", "--domain", domain}, {"may not write rig/command", "another role"});
    Program record(scratch, "trocar", {"record", "--domain", domain, "--out", (scratch / "seen.mcap").string()});
    const double end = steady_s() + answer_s;
    while (steady_s() < end &&
           (!std::filesystem::exists(scratch / "seen.mcap") || std::filesystem::file_size(scratch / "seen.mcap") < 20000))
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    record.signal(SIGINT);
    EXPECT_EQ(record.wait(answer_s), 0) << record.errors();
    EXPECT_GT(std::filesystem::file_size(scratch / "seen.mcap"), 20000U);
  }
  // Without keys, and with those of another authority: nobody is there.
  expect_refusal(scratch, "trocar", {"rig", "home", "--domain", domain}, {"no rig answers"});
  {
    const Keys as(scratch / "other/host");
    expect_refusal(scratch, "trocar", {"rig", "home", "--domain", domain}, {"no rig answers", "keys of the authority"});
  }
  {
    const Keys as(scratch / "nothing");
    expect_refusal(scratch, "trocar", {"rig", "home", "--domain", domain}, {"TROCAR_KEYS", "network.xml", "cannot be read"});
  }
}

TEST(Keys, AreNeverReplacedAndNeverHalfMade) {
  const Scratch scratch;
  ASSERT_EQ(make_keys(scratch, "keys"), 0);
  const std::string before = read_text(scratch / "keys/host/key.pem");
  EXPECT_EQ(std::filesystem::status(scratch / "keys/host/key.pem").permissions() & std::filesystem::perms::others_read,
            std::filesystem::perms::none);
  expect_refusal(scratch, "trocar", {"keys", (scratch / "keys").string(), "--interface", "lo", "--peer", "127.0.0.1"},
                 {"exists already", "choose a new folder"});
  EXPECT_EQ(read_text(scratch / "keys/host/key.pem"), before);
  expect_refusal(scratch, "trocar", {"keys", (scratch / "new").string(), "--interface", "e\"th", "--peer", "127.0.0.1"}, {"no interface"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "new"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "new.part"));
}

TEST(Keys, AnOpenNetworkIsRefusedUnlessAskedFor) {
  const Scratch scratch;
  const std::string rig_file = scratch.make_rig().string(), domain = std::to_string(own_domain());
  setenv("CYCLONEDDS_URI", "<General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces></General>", 1);
  const std::vector<std::string> start{"--rig", rig_file, "--domain", domain, "--best-effort"};
  expect_refusal(scratch, "trocar-rig", start, {"CYCLONEDDS_URI", "TROCAR_KEYS", "--open-network"});
  auto asked = start;
  asked.emplace_back("--open-network");
  Program rig(scratch, "trocar-rig", asked);
  EXPECT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();
  unsetenv("CYCLONEDDS_URI");
}

}  // namespace
}  // namespace trocar::testing
