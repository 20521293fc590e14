#include "common/mechanism/redundancy.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace trocar::mechanism {

Vec4 joint_torque(const Mat43& H, const Vec3& wrench) noexcept {
  const Mat3 gram = H.transpose() * H;
  return H * gram.llt().solve(wrench);
}

Vec4 actuator_torque(const Mat43& H, const Vec4& gear_ratio, const Vec3& wrench) noexcept {
  return joint_torque(gear_ratio.asDiagonal() * H, wrench);
}

Status end_point_least_norm(const TwinModel& model, const TwinState& state, const Vec3& wrench, Vec4& torque_nm,
                            Vec4& end_force_n) noexcept {
  if (!wrench.allFinite() || !state.x.allFinite()) return Status::NotFinite;
  Mat2 left, right;
  if (const Status status = jacobian(model.linkage[0], state.q.head<2>(), state.linkage[0], left); status != Status::Ok) return status;
  if (const Status status = jacobian(model.linkage[1], state.q.tail<2>(), state.linkage[1], right); status != Status::Ok) return status;
  const Vec2 n(-std::sin(state.x(2)), std::cos(state.x(2)));
  Mat43 J_o;
  J_o.topLeftCorner<2, 2>().setIdentity();
  J_o.bottomLeftCorner<2, 2>().setIdentity();
  J_o.topRightCorner<2, 1>() = -model.handle_m * n;
  J_o.bottomRightCorner<2, 1>() = (model.coupling_m - model.handle_m) * n;
  end_force_n = joint_torque(J_o, wrench);
  torque_nm.head<2>() = left.transpose() * end_force_n.head<2>();
  torque_nm.tail<2>() = right.transpose() * end_force_n.tail<2>();
  return Status::Ok;
}

}  // namespace trocar::mechanism
