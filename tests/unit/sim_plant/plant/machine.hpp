// The shipped rig, plant and scene, and a stand-in for a controller: springs and dampers towards a pose, computed from the truth.
#pragma once

#include <Eigen/LU>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "common/config/rig_file.hpp"
#include "sim_plant/plant/plant.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace trocar::sim_plant {

inline std::filesystem::path shared(const std::string& file) { return std::filesystem::path(TROCAR_SHARE) / file; }
inline rig::Rig shipped_rig() { return config::read_rig(shared("rigs/ubc_twin.toml")); }
inline PlantConfig shipped_plant() { return read_plant(shared("plants/ubc_twin.toml")); }
inline scene::Scene shipped_scene() { return scene::read_scene(shared("scenes/phantom.toml")); }

struct Machine {
  explicit Machine(const PlantConfig& config = shipped_plant(), std::uint64_t seed = 1)
      : rig(shipped_rig()), plant(rig, config, shipped_scene(), seed) {}

  // Motor torques of least norm that put `wrench` on the handle.
  std::array<double, 4> motor_torque(const mechanism::Vec3& wrench) const {
    const auto pose = plant.pose();
    mechanism::TwinState state;
    mechanism::Mat43 map;
    (void)mechanism::at_pose(rig.twin, {pose[0], pose[1], pose[2]}, mechanism::Vec4::Zero(), state);
    (void)mechanism::velocity_map(rig.twin, state, map);
    const mechanism::Mat3 gram = map.transpose() * map;
    const mechanism::Vec4 joint = map * gram.inverse() * wrench;
    std::array<double, 4> motor{};
    for (std::size_t i = 0; i < 4; ++i)
      motor[i] = joint(static_cast<Eigen::Index>(i)) / (rig.actuation.gear_ratio[i] * rig.actuation.gear_efficiency);
    return motor;
  }

  // One millisecond of spring and damper towards target(time_s).
  template <class Target>
  void follow(double duration_s, const Target& target) {
    const int ticks = static_cast<int>(duration_s * 1000.0 + 0.5);
    for (int k = 0; k < ticks; ++k) {
      const std::array<double, 3> goal = target(1e-3 * (k + 1));
      const auto x = plant.pose();
      const auto v = plant.velocity();
      const mechanism::Vec3 wrench(2000 * (goal[0] - x[0]) - 30 * v[0], 2000 * (goal[1] - x[1]) - 30 * v[1],
                                   2 * (goal[2] - x[2]) - 0.03 * v[2]);
      plant.advance_to(plant.time_ns() + 1'000'000, motor_torque(wrench));
    }
  }

  rig::Rig rig;
  Plant plant;
};

}  // namespace trocar::sim_plant
