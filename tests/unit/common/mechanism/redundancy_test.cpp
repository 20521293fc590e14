#include "common/mechanism/redundancy.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::RandomPoses;
using testing::uneven_twin;

// The joint torques that no wrench shows: 4-vector orthogonal to the columns of G.
Vec4 internal(const Mat43& G) {
  const Eigen::FullPivLU<Mat34> lu(G.transpose());
  EXPECT_EQ(lu.dimensionOfKernel(), 1);
  return Vec4(lu.kernel().col(0)).normalized();
}

// Least norm by another road: the optimality system [I G; G^T 0] (tau, lambda) = (0, u).
Vec4 least_norm(const Mat43& G, const Vec3& u) {
  Eigen::Matrix<double, 7, 7> kkt = Eigen::Matrix<double, 7, 7>::Zero();
  kkt.topLeftCorner<4, 4>().setIdentity();
  kkt.topRightCorner<4, 3>() = G;
  kkt.bottomLeftCorner<3, 4>() = G.transpose();
  Eigen::Matrix<double, 7, 1> right = Eigen::Matrix<double, 7, 1>::Zero();
  right.tail<3>() = u;
  return Eigen::Matrix<double, 7, 1>(kkt.fullPivLu().solve(right)).head<4>();
}

class Redundancy : public ::testing::Test {
 protected:
  const TwinModel model_ = uneven_twin();
  RandomPoses poses_{model_};
  TwinState state_;
  Mat43 H_;
  Vec3 wrench_;

  void next() {
    state_ = poses_.next();
    ASSERT_EQ(velocity_map(model_, state_, H_), Status::Ok);
    wrench_ = poses_.vector<Vec3>(10.0).cwiseProduct(Vec3(1.0, 1.0, 0.02));
  }
  void expect_least(const Mat43& G, const Vec4& torque) {
    EXPECT_LT((G.transpose() * torque - wrench_).norm(), 1e-10 * wrench_.norm());
    EXPECT_LT((torque - least_norm(G, wrench_)).norm(), 1e-9 * torque.norm());
    const Vec4 null = internal(G);
    for (const double size : {-1.0, -1e-3, -1e-6, 1e-6, 1e-3, 1.0}) {
      const Vec4 other = torque + size * torque.norm() * null;
      EXPECT_LT((G.transpose() * other - wrench_).norm(), 1e-10 * (wrench_.norm() + G.norm() * other.norm()));
      EXPECT_GE(other.squaredNorm(), torque.squaredNorm());
    }
  }
};

TEST_F(Redundancy, JointTorqueGivesTheWrenchAndNoOtherIsSmaller) {
  for (int i = 0; i < 200; ++i) {
    next();
    expect_least(H_, joint_torque(H_, wrench_));
  }
}

TEST_F(Redundancy, ActuatorTorqueGivesTheWrenchThroughTheGearsAndNoOtherIsSmaller) {
  const Vec4 gear_ratio(8.0, 6.0, 3.5, 12.0);
  for (int i = 0; i < 200; ++i) {
    next();
    const Mat43 geared = gear_ratio.asDiagonal() * H_;  // H^T W tau' = u
    const Vec4 motor = actuator_torque(H_, gear_ratio, wrench_);
    expect_least(geared, motor);
    const Vec4 joint = gear_ratio.cwiseProduct(motor);
    EXPECT_LT((H_.transpose() * joint - wrench_).norm(), 1e-10 * wrench_.norm());
    EXPECT_GE(joint.norm(), joint_torque(H_, wrench_).norm() * (1.0 - 1e-12));
  }
}

TEST_F(Redundancy, EqualGearsDoNotChangeTheDistribution) {
  for (int i = 0; i < 20; ++i) {
    next();
    const Vec4 motor = actuator_torque(H_, Vec4::Constant(8.0), wrench_);
    EXPECT_LT((8.0 * motor - joint_torque(H_, wrench_)).norm(), 1e-10 * motor.norm());
  }
}

TEST_F(Redundancy, WorkAtTheJointsIsWorkAtTheHandle) {
  const Vec4 gear_ratio(8.0, 6.0, 3.5, 12.0);
  for (int i = 0; i < 200; ++i) {
    next();
    // A small displacement that the mechanism really makes, not one that H promises.
    const Vec3 displacement = 1e-6 * poses_.vector<Vec3>(1.0).cwiseProduct(Vec3(1.0, 1.0, 20.0));
    Vec4 ahead, behind;
    ASSERT_EQ(inverse(model_, state_.x + displacement, state_.q, ahead), Status::Ok);
    ASSERT_EQ(inverse(model_, state_.x - displacement, state_.q, behind), Status::Ok);
    const Vec4 dq = ahead - behind;
    const double work = wrench_.dot(2.0 * displacement), scale = wrench_.norm() * displacement.norm();
    Vec4 torque, force;
    ASSERT_EQ(end_point_least_norm(model_, state_, wrench_, torque, force), Status::Ok);
    EXPECT_NEAR(joint_torque(H_, wrench_).dot(dq), work, 1e-6 * scale);
    EXPECT_NEAR(actuator_torque(H_, gear_ratio, wrench_).dot(gear_ratio.cwiseProduct(dq)), work, 1e-6 * scale);
    EXPECT_NEAR(torque.dot(dq), work, 1e-6 * scale);
  }
}

TEST_F(Redundancy, LeastEndPointForcesDoNotStrainTheCoupling) {
  for (int i = 0; i < 200; ++i) {
    next();
    Vec4 torque, force;
    ASSERT_EQ(end_point_least_norm(model_, state_, wrench_, torque, force), Status::Ok);
    const Vec2 d(std::cos(state_.x(2)), std::sin(state_.x(2))), f0 = force.head<2>(), f1 = force.tail<2>();
    // Statics of the coupling about the handle.
    const auto moment = [&](double arm, const Vec2& f) { return arm * (d.x() * f.y() - d.y() * f.x()); };
    EXPECT_LT((f0 + f1 - wrench_.head<2>()).norm(), 1e-11 * wrench_.norm());
    EXPECT_NEAR(moment(-model_.handle_m, f0) + moment(model_.coupling_m - model_.handle_m, f1), wrench_(2), 1e-11 * wrench_.norm());
    // Equal and opposite forces along the coupling are the only freedom left, and the least norm has none of them.
    EXPECT_NEAR((f1 - f0).dot(d), 0.0, 1e-11 * force.norm());
    EXPECT_LT((H_.transpose() * torque - wrench_).norm(), 1e-10 * wrench_.norm());
    EXPECT_GE(torque.norm(), joint_torque(H_, wrench_).norm() * (1.0 - 1e-12));
  }
}

TEST_F(Redundancy, EndPointForcesAreRefusedWhereALinkageIsSingular) {
  next();
  state_.linkage[1].elbow[0] = state_.linkage[1].end - Vec2(0.16, 0.0);
  state_.linkage[1].elbow[1] = state_.linkage[1].end + Vec2(0.158, 0.0);
  Vec4 torque = Vec4::Constant(9.0), force = torque;
  EXPECT_EQ(end_point_least_norm(model_, state_, wrench_, torque, force), Status::Singular);
  EXPECT_EQ(torque, Vec4(Vec4::Constant(9.0)));
  state_ = poses_.next();
  wrench_(1) = std::nan("");
  EXPECT_EQ(end_point_least_norm(model_, state_, wrench_, torque, force), Status::NotFinite);
}

}  // namespace
}  // namespace trocar::mechanism
