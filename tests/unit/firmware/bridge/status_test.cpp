// What the bridge says of the loop and its machine, to whoever listens.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/config/rig_file.hpp"
#include "common/wire/dds.hpp"
#include "common/wire/types.hpp"
#include "firmware/bridge/bridge.hpp"

namespace trocar::bridge {
namespace {

struct Listening {
  rig::Rig rig = config::read_rig(std::filesystem::path(TROCAR_SHARE) / "rigs/ubc_twin.toml");
  std::unique_ptr<controller::Mailboxes> mail = std::make_unique<controller::Mailboxes>();
  std::unique_ptr<Shared> shared = std::make_unique<Shared>();
  std::optional<wire::Participant> participant;
  std::optional<wire::Reader<wire::Status>> reader;
  std::optional<Bridge> bridge;
  wire::Status last{};

  Listening() {
    rig.dds_domain = 100U + static_cast<std::uint32_t>(getpid()) % 101U;
    participant.emplace(rig.dds_domain);
    reader.emplace(*participant);
    bridge.emplace(rig, *mail, *shared, std::filesystem::temp_directory_path() / "flight");  // nothing is recorded here
  }

  // Of a rig that is homed and at rest.
  void say(const LoopCounters& loop) {
    Shared::Snapshot snapshot{};
    snapshot.status.mode = Mode::Ready;
    snapshot.status.homed = true;
    snapshot.operational = true;
    snapshot.loop = loop;
    shared->snapshots.push(snapshot);
  }

  bool until(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    wire::WaitSet wait(*participant);
    wait.add(reader->entity());
    while (!condition() && std::chrono::steady_clock::now() < end) {
      (void)wait.wait(std::chrono::milliseconds(20));
      reader->take([&](const wire::Status& s) { last = s; });
    }
    return condition();
  }
};

TEST(Status, CarriesMachineAndLoopAndTellsWhatDisturbedAnArmedLoop) {
  Listening l;
  l.bridge->report_real_time(true, "", "Linux made up, core 3");
  l.say({.overruns = 5, .minor_faults = 40, .allocations = 3});
  ASSERT_TRUE(l.until([&] { return l.last.overruns == 5; }));
  EXPECT_STREQ(l.last.machine, "Linux made up, core 3");
  EXPECT_TRUE(l.last.real_time);
  EXPECT_EQ(l.last.minor_faults, 40u);
  EXPECT_EQ(l.last.allocations, 3u);
  EXPECT_STREQ(l.last.text, "");  // what came before arming is nothing to tell

  l.say({.overruns = 6, .armed_page_faults = 7, .armed_allocations = 2});
  ASSERT_TRUE(l.until([&] { return l.last.overruns == 6; }));
  EXPECT_NE(std::string(l.last.text).find("7 page faults and 2 allocations in the loop while armed"), std::string::npos) << l.last.text;
  EXPECT_EQ(l.last.fault, static_cast<std::uint8_t>(Fault::None));
}

}  // namespace
}  // namespace trocar::bridge
