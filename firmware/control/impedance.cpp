#include "firmware/control/impedance.hpp"

#include <Eigen/Cholesky>

namespace trocar::control {

using mechanism::Vec3;

namespace {

// B_d x' + K_d (x - x_0)
Vec3 own_force(const ImpedanceConfig& config, const DeviceState& device) noexcept {
  return config.damping.cwiseProduct(device.velocity) + config.stiffness.cwiseProduct(device.pose - config.rest_pose_m_rad);
}

}  // namespace

Vec3 impedance_force(const ImpedanceConfig& config, const DeviceState& device, const Vec3& f_m) noexcept {
  const Vec3 without_hand = f_m - own_force(config, device);
  const Vec3 coriolis = device.C * device.velocity;
  if (config.device_mass) return without_hand + coriolis;
  const Vec3 acceleration = (device.hand_force + without_hand).cwiseQuotient(config.mass);
  return device.M * acceleration + coriolis - device.hand_force;
}

Vec3 display_force(const ImpedanceConfig& config, const DeviceState& device, const Vec3& u) noexcept {
  const Vec3 coriolis = device.C * device.velocity;
  if (config.device_mass) return u - coriolis + own_force(config, device);
  const Vec3 acceleration = device.M.llt().solve(u - coriolis + device.hand_force);
  return config.mass.cwiseProduct(acceleration) - device.hand_force + own_force(config, device);
}

}  // namespace trocar::control
