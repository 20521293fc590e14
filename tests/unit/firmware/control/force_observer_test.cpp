// The observer of the twin against statics, closed forms and the simulated body. Sign throughout: the hand's push on the handle.
#include "firmware/control/force_observer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <random>

#include "common/config/rig_file.hpp"
#include "common/mechanism/redundancy.hpp"
#include "sim_plant/mechanism/twin_body.hpp"

namespace trocar::control {
namespace {

using mechanism::Mat2;
using mechanism::Mat3;
using mechanism::Mat43;
using mechanism::Status;
using mechanism::TwinState;
using mechanism::Vec2;
using mechanism::Vec3;
using mechanism::Vec4;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

rig::Rig haptic() { return config::read_twin(std::filesystem::path(TROCAR_SHARE) / "rigs/ubc_twin_haptic.toml"); }

// A handle whose mass does not lie halfway, so that both linkages carry different shares and the spare inertia is not small.
rig::Rig lopsided() {
  rig::Rig rig = haptic();
  rig.twin.handle_com_m = 0.015;
  rig.twin.handle_inertia_kg_m2 = 2e-4;
  return rig;
}

rig::Rig without_friction(rig::Rig rig) {
  rig.actuation.friction_coulomb_nm = 0.0;
  rig.actuation.friction_viscous_nm_s = 0.0;
  return rig;
}

TwinState state_at(const rig::Rig& rig, const Vec3& pose) {
  TwinState at;
  EXPECT_EQ(mechanism::at_pose(rig.twin, pose, Vec4::Zero(), at), Status::Ok);
  return at;
}

Mat43 map_at(const rig::Rig& rig, const TwinState& at) {
  Mat43 H;
  EXPECT_EQ(mechanism::velocity_map(rig.twin, at, H), Status::Ok);
  return H;
}

sim_plant::TwinBodyConfig body_of(const rig::Rig& rig) {
  sim_plant::TwinBodyConfig body;
  body.model = rig.twin;
  const auto& f = rig.actuation;
  body.friction.fill({f.friction_coulomb_nm, f.friction_viscous_nm_s, f.friction_coulomb_nm / 2.5e-4, 0.0});
  body.stop = {{-0.06, 0.06}, {0.09, 0.21}, 5e4, 150.0, 0.2};
  return body;
}

// For angles without counts.
ForceObserverConfig exact(const rig::Rig& rig, ObserverKind kind, double bandwidth_rad_s) {
  ForceObserverConfig config = force_observer_config(rig, kind, bandwidth_rad_s);
  config.play_rad = 0.0;
  return config;
}

// The body moves freely under constant motor torques and a hand; the observer sees it at every tick, without quantisation.
struct Free {
  rig::Rig rig;
  sim_plant::TwinBody body;
  ForceObserverConfig config;
  ForceObserverState state{};
  double tick_s;

  Free(const rig::Rig& r, ObserverKind kind, double bandwidth, double tick = 1e-3, const Vec3& pose = {0.01, 0.14, 1.2})
      : rig(r), body(body_of(r)), config(exact(r, kind, bandwidth)), tick_s(tick) {
    EXPECT_EQ(body.place(pose), Status::Ok);
    EXPECT_EQ(update(config, state, body.joint_angle_rad(), Vec4::Zero(), tick_s), Status::Ok);
  }
  void tick(const Vec3& hand, const Vec4& torque = Vec4::Zero()) {
    constexpr int steps = 40;
    for (int i = 0; i < steps; ++i) body.step(torque, hand, tick_s / steps);
    ASSERT_EQ(update(config, state, body.joint_angle_rad(), torque, tick_s), Status::Ok);
  }
};

class ForceObserver : public ::testing::TestWithParam<ObserverKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, ForceObserver, ::testing::Values(ObserverKind::Nicosia, ObserverKind::Momentum),
                         [](const auto& kind) { return kind.param == ObserverKind::Nicosia ? "Nicosia" : "Momentum"; });

TEST_P(ForceObserver, ReadsAPushAsAPush) {
  const double push = 0.5;
  for (int axis = 0; axis < 2; ++axis) {
    Free f(without_friction(haptic()), GetParam(), 390.0);
    Vec3 hand = Vec3::Zero();
    hand(axis) = push;
    for (int n = 0; n < 60; ++n) f.tick(hand);
    EXPECT_GT(f.body.velocity()(axis), 0.0);
    EXPECT_NEAR(f.state.estimate.wrench(axis), push, 0.005 * push);
    EXPECT_NEAR(f.state.estimate.wrench(1 - axis), 0.0, 0.005 * push);
    EXPECT_NEAR(f.state.estimate.wrench(2), 0.0, 1e-5);
    EXPECT_NEAR(f.state.estimate.handle_velocity(axis), f.body.velocity()(axis), 2e-3 * f.body.velocity()(axis));
  }
}

TEST_P(ForceObserver, ReadsATwistAsATwistAlsoWithALopsidedHandle) {
  Free f(without_friction(lopsided()), GetParam(), 390.0);
  const Vec3 hand(0.0, 0.0, 0.01);
  for (int n = 0; n < 60; ++n) f.tick(hand);
  EXPECT_GT(f.body.velocity()(2), 0.0);
  EXPECT_NEAR(f.state.estimate.wrench(2), 0.01, 1e-4);
  EXPECT_NEAR(f.state.estimate.wrench(0), 0.0, 5e-3);
  EXPECT_NEAR(f.state.estimate.wrench(1), 0.0, 5e-3);
}

// The motors hold the handle against the hand: the force is there, nothing moves.
TEST_P(ForceObserver, IsExactForAPushThatTheMotorsHoldAtEveryPoseAndTick) {
  const rig::Rig rig = haptic();
  const ForceObserverConfig config = exact(rig, GetParam(), 390.0);
  const Vec3 hand(6.0, -3.0, 0.04);
  for (const double tick_s : {2.5e-4, 1e-3, 4e-3})
    for (const double x : {-0.04, 0.0, 0.04})
      for (const double y : {0.11, 0.15, 0.19})
        for (const double theta : {-2.0, 0.3, 1.57}) {
          const TwinState at = state_at(rig, {x, y, theta});
          const Mat43 H = map_at(rig, at);
          const Vec4 torque = mechanism::joint_torque(H, -hand);
          ForceObserverState s;
          for (int n = 0; n < 40 + static_cast<int>(0.12 / tick_s); ++n) ASSERT_EQ(update(config, s, at.q, torque, tick_s), Status::Ok);
          ASSERT_NEAR((s.estimate.wrench - hand).norm(), 0.0, 1e-8) << tick_s << ' ' << x << ' ' << y << ' ' << theta;
          ASSERT_NEAR((s.estimate.external_torque + torque).norm(), 0.0, 1e-9);
          ASSERT_NEAR(s.estimate.joint_velocity.norm(), 0.0, 1e-9);
        }
}

TEST(Nicosia, HoldsJTransposeForceEqualToGainTimesAngleError) {
  const rig::Rig rig = haptic();
  const double w = 390.0, tick_s = 1e-3;
  const ForceObserverConfig config = exact(rig, ObserverKind::Nicosia, w);
  const TwinState at = state_at(rig, {0.02, 0.13, 1.0});
  const Vec4 torque = mechanism::joint_torque(map_at(rig, at), -Vec3(4.0, 1.0, 0.02));
  ForceObserverState s;
  for (int n = 0; n < 300; ++n) ASSERT_EQ(update(config, s, at.q, torque, tick_s), Status::Ok);
  const DisturbanceGains gains = disturbance_gains(w, tick_s);
  for (std::size_t k = 0; k < 2; ++k) {
    const auto row = static_cast<Eigen::Index>(2 * k);
    Mat2 D, C;
    ASSERT_EQ(mechanism::dynamics(config.model.linkage[k], at.q.segment<2>(row), Vec2::Zero(), D, C), Status::Ok);
    // The state is that after the sample: 1 - a0 of the error has been taken back.
    const Vec2 left(at.q(row) - s.joint[2 * k].position, at.q(row + 1) - s.joint[2 * k + 1].position);
    const Vec2 e = left / gains.a0;
    const Vec2 held = gains.b / (tick_s * tick_s) * D * e;
    EXPECT_NEAR((held + torque.segment<2>(row)).norm(), 0.0, 1e-9);
  }
}

// At rest, free, pushed from t = 0 on: for some ms the pose does not change and the closed forms of the single mass hold.
TEST(ForceObserverResponse, IsThatOfTheSingleMass) {
  for (const double tick_s : {2.5e-4, 1e-3}) {
    const double w = 390.0, angle = w * tick_s / std::numbers::sqrt2, sampled = std::sinh(angle) / std::sin(angle);
    Free nicosia(without_friction(haptic()), ObserverKind::Nicosia, w, tick_s);
    Free momentum(without_friction(haptic()), ObserverKind::Momentum, w, tick_s);
    const Vec3 hand(0.3, 0.2, 0.0);
    for (int n = 1; n * tick_s < 0.025; ++n) {
      nicosia.tick(hand);
      momentum.tick(hand);
      const double t = n * tick_s;
      const double c = n * angle, second = 1.0 - std::exp(-c) * (std::cos(c) + sampled * std::sin(c)),
                   first = 1.0 - std::exp(-w * (t - tick_s));
      ASSERT_NEAR((nicosia.state.estimate.wrench.head<2>() - second * hand.head<2>()).norm(), 0.0, 2e-3 * hand.norm()) << t;
      ASSERT_NEAR((momentum.state.estimate.wrench.head<2>() - first * hand.head<2>()).norm(), 0.0, 2e-3 * hand.norm()) << t;
    }
  }
}

TEST_P(ForceObserver, ReadsNothingWhereOnlyMotorsPush) {
  Free f(without_friction(lopsided()), GetParam(), 390.0);
  const Vec4 torque = mechanism::joint_torque(map_at(f.rig, state_at(f.rig, f.body.pose())), Vec3(1.5, 1.0, 0.01));
  double most = 0.0, fastest = 0.0;
  for (int n = 0; n < 80; ++n) {
    f.tick(Vec3::Zero(), torque);
    most = std::max(most, f.state.estimate.wrench.head<2>().norm());
    fastest = std::max(fastest, f.body.velocity().head<2>().norm());
  }
  EXPECT_GT(fastest, 0.3);  // over this, Coriolis forces and the change of inertia matter
  EXPECT_LT(most, 0.02 * 1.8);
}

TEST_P(ForceObserver, TakesFrictionOutOfTheForce) {
  rig::Rig rig = haptic();
  rig.actuation.friction_coulomb_nm = 0.01;
  rig.actuation.friction_viscous_nm_s = 1e-3;
  Free f(rig, GetParam(), 390.0);
  ForceObserverConfig without = f.config;
  without.friction = {};
  ForceObserverState other;
  ASSERT_EQ(update(without, other, f.body.joint_angle_rad(), Vec4::Zero(), f.tick_s), Status::Ok);
  const Vec3 hand(0.8, 0.6, 0.0);
  for (int n = 0; n < 80; ++n) {
    f.tick(hand);
    ASSERT_EQ(update(without, other, f.body.joint_angle_rad(), Vec4::Zero(), f.tick_s), Status::Ok);
  }
  const double error = (f.state.estimate.wrench - hand).head<2>().norm(), uncompensated = (other.estimate.wrench - hand).head<2>().norm();
  EXPECT_GT(uncompensated, 0.1);
  EXPECT_LT(error, 0.1 * uncompensated);
}

// An encoder on the edge between two counts is no motion, and its friction no torque.
TEST_P(ForceObserver, DoesNotChatterWithFrictionOnTheEdgeOfACount) {
  const rig::Rig rig = haptic();
  const ForceObserverConfig with = exact(rig, GetParam(), 390.0);
  ForceObserverConfig without = with;
  without.friction = {};
  const TwinState at = state_at(rig, {0.0, 0.15, 1.57});
  const double count = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  ForceObserverState a, b;
  double most = 0.0;
  for (int n = 0; n < 400; ++n) {
    const Vec4 q = at.q + Vec4::Constant(n % 2 == 0 ? 0.0 : count);
    ASSERT_EQ(update(with, a, q, Vec4::Zero(), 1e-3), Status::Ok);
    ASSERT_EQ(update(without, b, q, Vec4::Zero(), 1e-3), Status::Ok);
    most = std::max(most, (a.estimate.external_torque - b.estimate.external_torque).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(most, 0.5 * rig.actuation.friction_coulomb_nm);
}

TEST_P(ForceObserver, RefusesWhatIsNotFiniteAndGoesOnAsIfATickHadBeenLonger) {
  Free f(haptic(), GetParam(), 390.0);
  const Vec3 hand(0.5, 0.0, 0.0);
  for (int n = 0; n < 30; ++n) f.tick(hand);
  ForceObserverState bad = f.state, longer = f.state;
  const Vec4 q = f.body.joint_angle_rad();
  Vec4 broken = q;
  broken(2) = nan;
  EXPECT_EQ(update(f.config, bad, broken, Vec4::Zero(), 1e-3), Status::NotFinite);
  EXPECT_EQ(bad.estimate.wrench, f.state.estimate.wrench);
  EXPECT_EQ(update(f.config, bad, q, Vec4(0.0, std::numeric_limits<double>::infinity(), 0.0, 0.0), 1e-3), Status::NotFinite);
  EXPECT_EQ(update(f.config, bad, q, Vec4::Constant(1e308), 1e-3), Status::NotFinite);
  EXPECT_EQ(update(f.config, bad, q, Vec4::Zero(), 0.0), Status::NotFinite);
  EXPECT_EQ(update(f.config, bad, q, Vec4::Zero(), nan), Status::NotFinite);
  const double together = std::acos(0.5 * f.rig.twin.linkage[0].base_m / f.rig.twin.linkage[0].proximal[0].length_m);  // the elbows
  EXPECT_EQ(update(f.config, bad, Vec4(together, std::numbers::pi - together, q(2), q(3)), Vec4::Zero(), 1e-3), Status::Singular);
  EXPECT_EQ(bad.estimate.wrench, f.state.estimate.wrench);
  EXPECT_EQ(bad.estimate.joint_velocity, f.state.estimate.joint_velocity);
  EXPECT_EQ(update(f.config, bad, q, Vec4::Zero(), 1e-3), Status::Ok);
  double gap = 1e-3;
  for (int n = 0; n < 4; ++n) gap += 1e-3;
  EXPECT_EQ(update(f.config, longer, q, Vec4::Zero(), gap), Status::Ok);
  EXPECT_EQ(bad.estimate.wrench, longer.estimate.wrench);
  EXPECT_EQ(bad.estimate.joint_velocity, longer.estimate.joint_velocity);
}

TEST_P(ForceObserver, FindsTheVelocityFromTheFastestMotionThoughStartedAtRest) {
  const rig::Rig rig = without_friction(haptic());
  Free f(rig, GetParam(), 200.0, 1e-3, {-0.04, 0.12, 1.0});
  f.body.set_velocity({0.8, 0.6, 5.0});  // rig.limits.fault_speed_m_s
  for (int n = 0; n < 60; ++n) f.tick(Vec3::Zero());
  const Vec3 error = f.state.estimate.handle_velocity - f.body.velocity();
  EXPECT_LT(error.head<2>().norm(), 0.02);
  EXPECT_LT(std::abs(error(2)), 0.2);
}

// With their shares of the handle the linkages have the inertia of the whole, but for the spare one.
TEST(ForceObserverConfig, LinkagesWithTheirSharesHaveTheInertiaOfTheTwin) {
  const rig::Rig rig = lopsided();
  const ForceObserverConfig config = exact(rig, ObserverKind::Nicosia, 390.0);
  for (const double theta : {0.0, 1.0, 2.5, 4.0}) {
    const TwinState at = state_at(rig, {0.02, 0.14, theta});
    const Mat43 H = map_at(rig, at);
    Mat3 sum = Mat3::Zero(), M, C;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto row = static_cast<Eigen::Index>(2 * k);
      Mat2 D, unused;
      ASSERT_EQ(mechanism::dynamics(config.model.linkage[k], at.q.segment<2>(row), Vec2::Zero(), D, unused), Status::Ok);
      sum += H.middleRows<2>(row).transpose() * D * H.middleRows<2>(row);
    }
    sum(2, 2) += config.spare_inertia_kg_m2;
    ASSERT_EQ(mechanism::dynamics(rig.twin, at, Vec3::Zero(), M, C), Status::Ok);
    EXPECT_NEAR((sum - M).norm(), 0.0, 1e-14);
  }
  EXPECT_NEAR(config.spare_inertia_kg_m2, 2e-4 - 0.3 * 0.7 * 0.15 * 0.05 * 0.05, 1e-18);
}

TEST(Admission, NamesWhatIsWrong) {
  const rig::Rig rig = haptic();
  const auto verdict = [&](ObserverKind kind, double bandwidth, double tick_hz = 1000.0, std::int32_t counts = 16000) {
    rig::Rig r = rig;
    r.timing.tick_hz = tick_hz;
    r.actuation.encoder_counts_per_turn = counts;
    return admit(force_observer_config(r, kind, bandwidth), r, 0.6).verdict;
  };
  using enum ObserverKind;
  EXPECT_EQ(verdict(Nicosia, 400.0), Admissible::Yes);
  EXPECT_EQ(verdict(Nicosia, 0.0), Admissible::NotPositive);
  EXPECT_EQ(verdict(Nicosia, nan), Admissible::NotPositive);
  EXPECT_EQ(verdict(Momentum, 400.0, 0.0), Admissible::NotPositive);
  EXPECT_EQ(verdict(Momentum, 400.0, 1000.0, 0), Admissible::NotPositive);
  EXPECT_EQ(verdict(Nicosia, 10.0), Admissible::TooSlowForSpeed);
  EXPECT_EQ(verdict(Momentum, 10.0), Admissible::Yes);
  EXPECT_EQ(verdict(Nicosia, 1990.0), Admissible::TooFastForTick);
  EXPECT_EQ(verdict(Nicosia, 1980.0), Admissible::EncoderTooCoarse);
  EXPECT_EQ(verdict(Nicosia, 400.0, 1000.0, 1000), Admissible::EncoderTooCoarse);

  ForceObserverConfig config = force_observer_config(rig, Nicosia, 400.0);
  config.friction[3].smoothing_rad_s = 1e-3;
  EXPECT_EQ(admit(config, rig, 0.6).verdict, Admissible::FrictionTooSteep);
  config.friction[3].smoothing_rad_s = 0.0;
  EXPECT_EQ(admit(config, rig, 0.6).verdict, Admissible::NotPositive);

  rig::Rig wide = rig;
  wide.limits.workspace_y_m[1] = 0.4;
  EXPECT_EQ(admit(force_observer_config(wide, Nicosia, 400.0), wide, 0.6).verdict, Admissible::NotAPose);
}

TEST(Admission, SpeedGainHasItsContinuousLimit) {
  rig::Rig rig = haptic();
  rig.timing.tick_hz = 1e5;
  const auto gain = [&](double w) { return admit(force_observer_config(rig, ObserverKind::Nicosia, w), rig, 1e9).speed_gain; };
  EXPECT_NEAR(gain(200.0) / gain(400.0), 2.0, 1e-4);  // 3 |D^-1 C| / (sqrt(2) w)
  EXPECT_EQ(admit(force_observer_config(rig, ObserverKind::Momentum, 200.0), rig, 1e9).speed_gain, 0.0);
}

// An angle on the edge between two counts, that flips at random: nothing is felt of it. In motion the play shows in neither force nor
// velocity.
TEST_P(ForceObserver, PlayHidesTheChatterOfACountAndNothingElse) {
  const rig::Rig rig = without_friction(haptic());
  const double count = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  std::mt19937 random(7);
  std::bernoulli_distribution up(0.5);
  const ForceObserverConfig config = force_observer_config(rig, GetParam(), 390.0);
  const TwinState at = state_at(rig, {0.01, 0.14, 1.2});
  ForceObserverState s;
  for (int i = 0; i < 500; ++i) {
    Vec4 q = at.q;
    for (Eigen::Index j = 0; j < 4; ++j) q(j) += up(random) ? count : 0.0;
    ASSERT_EQ(update(config, s, q, Vec4::Zero(), 1e-3), Status::Ok);
    if (i > 100) {
      ASSERT_LT(s.estimate.wrench.head<2>().norm(), 0.01);
      ASSERT_LT(s.estimate.joint_velocity.norm(), 1e-2 * 390.0 * count);
    }
  }
  Free f(rig, GetParam(), 390.0);
  f.config.play_rad = config.play_rad;
  for (int n = 0; n < 100; ++n) f.tick({0.5, 0.0, 0.0});
  EXPECT_NEAR(f.state.estimate.wrench(0), 0.5, 0.005 * 0.5);
  EXPECT_NEAR(f.state.estimate.handle_velocity(0), f.body.velocity()(0), 2e-3 * f.body.velocity()(0));
}

// White errors, uniform over a count, at one pose in the workspace: never above what is promised for the worst.
TEST_P(ForceObserver, CountNoiseStaysWithinWhatAdmissionSays) {
  const rig::Rig rig = without_friction(haptic());
  const double count = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> error(-0.5 * count, 0.5 * count);
  const ForceObserverConfig config = exact(rig, GetParam(), 390.0);
  double worst = 0.0;
  for (const double x : {-0.052, 0.0, 0.052})
    for (const double y : {0.098, 0.15, 0.202})
      for (int k = 0; k < 4; ++k) {
        const TwinState at = state_at(rig, {x, y, 2.0 * std::numbers::pi * k / 12.0});
        ForceObserverState s;
        double square = 0.0;
        constexpr int settling = 100, n = 4000;
        for (int i = 0; i < settling + n; ++i) {
          Vec4 q = at.q;
          for (Eigen::Index j = 0; j < 4; ++j) q(j) += error(random);
          ASSERT_EQ(update(config, s, q, Vec4::Zero(), 1e-3), Status::Ok);
          if (i >= settling) square += s.estimate.wrench.head<2>().squaredNorm();
        }
        worst = std::max(worst, std::sqrt(square / n));
      }
  const double said = admit(config, rig, 1e9).count_force_n;
  EXPECT_LT(worst, 1.05 * said);
  EXPECT_GT(worst, 0.7 * said);  // these are not all its poses
}

}  // namespace
}  // namespace trocar::control
