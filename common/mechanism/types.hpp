// Fixed-size algebra and the one status of common/mechanism. Nothing here or behind it allocates.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace trocar::mechanism {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec4 = Eigen::Vector4d;
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;
using Mat43 = Eigen::Matrix<double, 4, 3>;
using Mat34 = Eigen::Matrix<double, 3, 4>;

// Outputs are written only with Ok.
enum class Status : std::uint8_t {
  Ok,
  Unreachable,  // no such pose in the working and assembly mode of model.hpp
  Singular,     // a sine that the result divides by is below singular_sine
  NotFinite,    // NaN or infinity among the inputs
};

// Arms closer than this (rad) to stretched or folded, or distal links closer to parallel, count as singular: at 1e-6 the
// maps still carry ten digits, and any machine has been stopped long before by its rig's singularity limit.
inline constexpr double singular_sine = 1e-6;

}  // namespace trocar::mechanism
