// The closed loop in lock-step: the real controller, the real bus protocol, the simulated machine.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <vector>

#include "common/config/rig_file.hpp"
#include "common/scene/scene.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace trocar::sim_plant {
namespace {

struct LockStep {
  std::filesystem::path share{TROCAR_SHARE};
  rig::Rig rig = config::read_rig(share / "rigs/ubc_twin.toml");
  Bench bench;
  std::vector<Sample> samples;
  std::vector<Reply> replies;

  explicit LockStep(std::uint64_t seed)
      : bench(rig, read_plant(share / "plants/ubc_twin.toml"), scene::read_scene(share / "scenes/phantom.toml"), seed) {}

  void tick(int n) {
    for (int i = 0; i < n; ++i) {
      bench.mail().commands.push({.session = 1, .kind = CommandKind::KeepAlive});
      bench.tick();
      samples.push_back(bench.sample());
      Reply r;
      while (bench.mail().replies.pop(r)) replies.push_back(r);
    }
  }
  void send(Command c, int ticks) {
    c.session = 1;
    c.id = ++id;
    bench.mail().commands.push(c);
    tick(ticks);
  }
  [[nodiscard]] ReplyCode last() const { return replies.empty() ? ReplyCode::WrongVersion : replies.back().code; }
  void arm() {
    tick(1500);
    send({.kind = CommandKind::Home}, 100);
    send({.kind = CommandKind::Tare}, 300);
    send({.kind = CommandKind::Arm}, 300);
  }
  std::uint32_t id = 0;
};

// In the air, below the face of the tissue: 20 mm there at 10 mm/s.
TEST(ClosedLoop, TracksWithinATenthOfAMillimetreInTheAir) {
  LockStep r(1);
  r.arm();
  ASSERT_EQ(r.bench.sample().mode, Mode::Armed);
  const auto from = r.bench.sample().pose;
  // Aside and back, away from the tissue.
  r.send({.kind = CommandKind::Move, .target_pose = {0.02, from[1], from[2]}, .speed_m_s = 0.01, .angular_speed_rad_s = 1.0}, 2600);
  ASSERT_EQ(r.last(), ReplyCode::Done);
  double sum = 0.0;
  std::size_t n = 0;
  for (const Sample& s : r.samples)
    if (s.moving != 0) {
      sum += std::pow(s.pose[0] - s.setpoint_pose[0], 2) + std::pow(s.pose[1] - s.setpoint_pose[1], 2);
      ++n;
    }
  ASSERT_GT(n, 1500u);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(n)), 1e-4);
  // Against the machine itself, not only its encoders: links and coupling of the plant differ from the rig's by fractions of a millimetre.
  EXPECT_NEAR(r.bench.plant().physics().pose()[0], 0.02, 1e-3);
}

bool same(const Sample& a, const Sample& b) {
  const auto bits = [](const auto& x, const auto& y) { return std::memcmp(&x, &y, sizeof x) == 0; };
  return a.tick == b.tick && a.time_ns == b.time_ns && a.mode == b.mode && a.fault == b.fault && a.moving == b.moving &&
         bits(a.position_counts, b.position_counts) && bits(a.joint_torque_command_nm, b.joint_torque_command_nm) &&
         bits(a.joint_torque_measured_nm, b.joint_torque_measured_nm) && bits(a.pose, b.pose) && bits(a.velocity, b.velocity) &&
         bits(a.setpoint_pose, b.setpoint_pose) && bits(a.wrench_command, b.wrench_command) && bits(a.base_wrench, b.base_wrench) &&
         bits(a.residual_m, b.residual_m) && bits(a.singularity, b.singularity);
}

TEST(ClosedLoop, SameSeedGivesTheSameBitsAndAnotherDoesNot) {
  const auto run = [](std::uint64_t seed) {
    LockStep r(seed);
    r.arm();
    r.send({.kind = CommandKind::Move, .target_pose = {0.0, 0.13, 1.6}, .speed_m_s = 0.05, .angular_speed_rad_s = 1.0}, 800);
    return std::move(r.samples);
  };
  const auto a = run(5);
  const auto b = run(5);
  const auto c = run(6);
  ASSERT_EQ(a.size(), b.size());
  bool differs = false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(same(a[i], b[i])) << "tick " << i;
    differs = differs || !same(a[i], c[i]);
  }
  EXPECT_TRUE(differs);
}

}  // namespace
}  // namespace trocar::sim_plant
