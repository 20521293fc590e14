#include "sim_plant/wired/wired_plant.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "common/config/rig_file.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace trocar::sim_plant {
namespace {

constexpr std::int64_t millisecond = 1'000'000;

struct Held {
  explicit Held(const HandConfig& config = {})
      : rig(config::read_rig(share / "rigs/ubc_twin_haptic.toml")),
        plant(rig, read_plant(share / "plants/ubc_twin_haptic.toml"), std::nullopt, 1),
        hand(config, plant.physics().pose()) {
    plant.give_to(&hand);
  }
  std::filesystem::path share{TROCAR_SHARE};
  rig::Rig rig;
  WiredPlant plant;
  Hand hand;
};

// A process that was starved advances in long steps; the grip must not become a source of energy by it.
TEST(WiredPlant, AHandIsTheSameInLongStepsAndInShort) {
  HandConfig config;
  config.translation.tremor = 0.1;
  Held fine(config), coarse(config);
  for (Held* held : {&fine, &coarse}) {
    auto pose = held->plant.physics().pose();
    const auto start = pose;
    pose[1] += 0.03;
    held->hand.want({{0.0, start}, {0.2, pose}});
  }
  for (std::int64_t t = 50'000; t <= 500 * millisecond; t += 50'000) fine.plant.advance(t);
  for (std::int64_t t = 5 * millisecond; t <= 500 * millisecond; t += 5 * millisecond) coarse.plant.advance(t);
  EXPECT_EQ(fine.plant.physics().pose(), coarse.plant.physics().pose());
  EXPECT_EQ(fine.hand.wrench(), coarse.hand.wrench());
  EXPECT_GT(fine.plant.physics().pose()[1], fine.rig.homing_pose[1] + 0.02);
}

TEST(WiredPlant, PushesNoLongerWhenTheHandleIsTakenAway) {
  Held held;
  auto pose = held.plant.physics().pose();
  pose[1] += 0.008;
  held.hand.want({{0.0, pose}});
  held.plant.advance(20 * millisecond);
  held.plant.give_to(nullptr);
  held.plant.advance(1000 * millisecond);  // comes to rest by its friction
  const auto rest = held.plant.physics().pose();
  EXPECT_GT(rest[1], held.rig.homing_pose[1] + 1e-4);
  EXPECT_LT(rest[1], held.rig.homing_pose[1] + 0.05) << "far from the stops, where anything would rest";
  held.plant.advance(1500 * millisecond);
  EXPECT_NEAR(held.plant.physics().pose()[1], rest[1], 1e-4);
}

TEST(WiredPlant, APersonWaitsForTheMotors) {
  Held held;
  Habit habit;
  habit.way = {{0.0, {}}, {0.1, {0.03, 0.0, 0.0}}};
  Hand person({}, habit);
  held.plant.give_to(&person);
  EXPECT_FALSE(held.plant.motors_on());
  held.plant.advance(200 * millisecond);
  EXPECT_FALSE(person.holds());
  EXPECT_NEAR(held.plant.physics().pose()[1], held.rig.homing_pose[1], 1e-6);
}

}  // namespace
}  // namespace trocar::sim_plant
