#include "firmware/control/four_channel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

namespace trocar::control {
namespace {

using mechanism::Vec3;
using Complex = std::complex<double>;

// The general architecture (Lawrence 1993; with local force feedback C_5, C_6: Hashtrudi-Zaad and Salcudean 2001), one axis:
//   (Z_m + C_m) v_m = (1 + C_6) f_h - C_2 f_e - C_4 v_s,   (Z_s + C_s) v_s = C_1 v_m + C_3 f_h - (1 + C_5) f_e
struct General {
  Complex Zcm, Zcs, C1, C2, C3, C4, C5, C6;
};
struct Seen {
  Complex force_by_velocity, force_by_force, velocity_by_velocity, velocity_by_force;  // (f_h, v_s) from (v_m, f_e)
};
Seen seen(const General& g) {
  // [1 + C6, -C4; C3, -Zcs] (f_h, v_s) = (Zcm v_m + C2 f_e, -C1 v_m + (1 + C5) f_e)
  const Complex a = 1.0 + g.C6, b = -g.C4, c = g.C3, d = -g.Zcs, det = a * d - b * c;
  const auto solve = [&](Complex p, Complex q) { return std::pair{(d * p - b * q) / det, (a * q - c * p) / det}; };
  const auto [f_v, v_v] = solve(g.Zcm, -g.C1);
  const auto [f_f, v_f] = solve(g.C2, 1.0 + g.C5);
  return {f_v, f_f, v_v, v_f};
}

constexpr double k_frequencies[] = {0.5, 3.0, 20.0, 100.0};  // rad/s
Complex local(const LocalController& c, double w) { return c.damping[0] + c.stiffness[0] / Complex(0, w); }
Complex mass(double m, double w) { return {0, m * w}; }

// The thesis's choice, as update() implements it.
General thesis(const FourChannelConfig& config, double master_mass, double w) {
  const Complex cm = local(config.master, w), cs = local(config.slave, w);
  return {mass(master_mass, w) + cm, mass(config.needle.mass[0], w) + config.needle.damping[0] + cs, cs, 1.0, 1.0, -cm, 0.0, 0.0};
}

TEST(FourChannel, ConditionsOfTransparencyGiveAnIdealTwoPort) {
  for (const double w : k_frequencies)
    for (const Complex local_force : {Complex(0.0), Complex(0.7), Complex(-0.4, 0.2)}) {
      const Complex Zcm = mass(0.3, w) + local(thesis_local_controller, w), Zcs = mass(0.5, w) + local(thesis_local_controller, w);
      const Seen s = seen({Zcm, Zcs, Zcs, 1.0 + local_force, 1.0 + local_force, -Zcm, local_force, local_force});
      EXPECT_LT(std::abs(s.force_by_velocity), 1e-12);
      EXPECT_LT(std::abs(s.force_by_force - 1.0), 1e-12);
      EXPECT_LT(std::abs(s.velocity_by_velocity - 1.0), 1e-12);
      EXPECT_LT(std::abs(s.velocity_by_force), 1e-12);
    }
}

TEST(FourChannel, ThesisChoiceMeetsThemButForTheImpedanceOfTheSlave) {
  FourChannelConfig config;
  config.needle.damping[0] = 0.0;
  for (const double w : k_frequencies)
    for (const double m : {0.3, 0.03, 0.003}) {
      config.needle.mass[0] = m;
      const Seen s = seen(thesis(config, m, w));
      EXPECT_LT(std::abs(s.force_by_velocity - mass(m, w)), 1e-10);  // felt too much: Z_s, and that vanishes with the masses
      EXPECT_LT(std::abs(s.force_by_force - 1.0), 1e-12);
      EXPECT_LT(std::abs(s.velocity_by_velocity - 1.0), 1e-12);
      EXPECT_LT(std::abs(s.velocity_by_force), 1e-12);
    }
}

TEST(FourChannel, DefaultsAreThoseOfThePrint) {
  const FourChannelConfig config;
  for (const Eigen::Index i : {0, 1}) {
    EXPECT_EQ(config.master.damping[i], 35.0);
    EXPECT_EQ(config.slave.damping[i], 35.0);
    EXPECT_EQ(config.master.stiffness[i], 100.0);
    EXPECT_EQ(config.slave.stiffness[i], 100.0);
    EXPECT_EQ(config.adaptive.least[i], 0.0);
  }
  EXPECT_EQ(config.adaptive.per_force_s_m, 60.0);
}

// A hand that swings an ideal master M_d x'' = f_h + f_m, the slave on spring and damper; felt impedance by correlation over whole
// periods after the transient. `step` fine, so that the sampling does not matter.
Complex felt(const FourChannelConfig& config, double master_mass, double stiffness, double damping, double w) {
  constexpr double tau = 2.0 * 3.14159265358979323846;
  const int per_period = static_cast<int>(std::ceil(tau / w / 2e-5));
  const double dt = tau / w / per_period;
  const int settle = static_cast<int>(std::ceil(4.0 * w / tau)) + 2;
  double x = 0.0, v = 0.0;
  SlaveState slave;
  Complex force_sum, velocity_sum;
  for (int k = 0; k < (settle + 2) * per_period; ++k) {
    const double f_h = std::sin(w * k * dt);
    const double f_e = stiffness * slave.pose[0] + damping * slave.velocity[0];
    const double v_before = v;
    const double f_m = update(config, slave, {{x, 0, 0}, {v, 0, 0}, {f_h, 0, 0}, {f_e, 0, 0}, dt})[0];
    v += dt * (f_h + f_m) / master_mass;
    x += dt * v;
    if (k >= settle * per_period) {
      const Complex turn = std::polar(1.0, -w * k * dt);
      force_sum += f_h * turn;
      velocity_sum += 0.5 * (v_before + v) * std::polar(1.0, -0.5 * w * dt) * turn;  // mean of the step, at its middle
    }
  }
  return force_sum / velocity_sum;
}

TEST(FourChannel, FeltImpedanceIsSlavePlusEnvironment) {
  FourChannelConfig config;  // adaptive damping included: with equal masses nothing moves apart for it to act on
  for (const double w : k_frequencies)
    for (const auto& [stiffness, damping] : {std::pair{0.0, 5.0}, {200.0, 1.0}, {1500.0, 4.0}}) {
      const Complex wanted = mass(config.needle.mass[0], w) + damping + stiffness / Complex(0, w);
      const Complex got = felt(config, config.needle.mass[0], stiffness, damping, w);
      EXPECT_LT(std::abs(got - wanted), 0.01 * std::abs(wanted)) << w << ' ' << stiffness << ' ' << got << ' ' << wanted;
    }
}

TEST(FourChannel, FeltImpedanceFollowsTheTwoPortWhenTheMassesDiffer) {
  FourChannelConfig config;
  config.needle.mass[0] = 0.15;
  config.adaptive.per_force_s_m = 0.0;  // linear
  const double master_mass = 0.45;
  for (const double w : k_frequencies) {
    const Complex environment = 2.0 + 300.0 / Complex(0, w);
    const Seen s = seen(thesis(config, master_mass, w));
    // f_e = Z_e v_s closes the port.
    const Complex v_s = s.velocity_by_velocity / (1.0 - s.velocity_by_force * environment);
    const Complex wanted = s.force_by_velocity + s.force_by_force * environment * v_s;
    const Complex got = felt(config, master_mass, 300.0, 2.0, w);
    EXPECT_LT(std::abs(got - wanted), 0.01 * std::abs(wanted)) << w << ' ' << got << ' ' << wanted;
  }
}

TEST(FourChannel, LighterPairComesCloserToTransparency) {
  FourChannelConfig config;
  const double w = 20.0;
  const Complex environment = 1.0 + 400.0 / Complex(0, w);
  double before = 0.0;
  for (const double m : {0.4, 0.2, 0.1}) {
    config.needle.mass[0] = m;
    const double too_much = std::abs(felt(config, m, 400.0, 1.0, w) - environment);
    EXPECT_NEAR(too_much, m * w, 0.02 * m * w);
    if (before > 0.0) {
      EXPECT_NEAR(too_much, 0.5 * before, 0.02 * before);
    }
    before = too_much;
  }
}

TEST(FourChannel, MasterCommandAndSlaveStepByHand) {
  FourChannelConfig config;
  config.needle.mass = {0.5, 0.5, 1e-3};
  SlaveState slave{{0.01, 0.0, 0.1}, {0.2, 0.0, 1.0}};
  const DisplayInput in{{0.012, 0.0, 0.0}, {0.1, 0.0, 0.0}, {3.0, 0.0, 0.0}, {1.5, 2.0, -0.02}, 1e-3};
  const Vec3 f_m = update(config, slave, in);
  EXPECT_NEAR(f_m[0], 35.0 * 0.1 + 100.0 * -0.002 - 1.5, 1e-12);
  EXPECT_NEAR(f_m[2], 0.035 * 1.0 + 0.1 * 0.1 + 0.02, 1e-12);
  const double damping = 35.0 + 60.0 * 2.5;  // |f_e| = 2.5 N in the plane
  const double v = (0.5 / 1e-3 * 0.2 + damping * 0.1 + 100.0 * (0.012 + 1e-4 - 0.01) + 3.0 - 1.5) / (0.5 / 1e-3 + damping + 0.1);
  EXPECT_NEAR(slave.velocity[0], v, 1e-12);
  EXPECT_NEAR(slave.pose[0], 0.01 + 1e-3 * v, 1e-15);
  EXPECT_NEAR(adaptive_damping(config.adaptive, in.environment_force)[2], 1.9 * 0.02, 1e-15);
}

TEST(FourChannel, AnyAdaptiveDampingIsStable) {
  // 60 s/m * 1000 N = 60 kN s/m on 0.3 kg: explicit integration would need steps of 10 us. The slave takes the master's velocity.
  FourChannelConfig config;
  config.slave.stiffness.setZero();
  SlaveState slave;
  const double v_m = 0.1;
  for (int k = 0; k < 100; ++k) {
    (void)update(config, slave, {{k * 1e-3 * v_m, 0, 0}, {v_m, 0, 0}, {1000, 0, 0}, {1000, 0, 0}, 1e-3});
    EXPECT_GE(slave.velocity[0], 0.0);
    EXPECT_LE(slave.velocity[0], v_m * (1 + 1e-12));
  }
  EXPECT_NEAR(slave.velocity[0], v_m, 1e-9);
}

TEST(FourChannel, SlaveBearsAWallUpToTheStatedStiffness) {
  FourChannelConfig config;
  config.adaptive.per_force_s_m = 0.0;
  const double stiffness = 0.9 * 4.0 * config.needle.mass[0] / 1e-6;
  SlaveState slave;
  slave.pose[0] = 1e-6;
  double last = 0.0;
  for (int k = 0; k < 3000; ++k) {
    (void)update(config, slave, {Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), {stiffness * slave.pose[0], 0, 0}, 1e-3});
    last = slave.pose[0];
  }
  EXPECT_LT(std::abs(last), 1e-9);
}

}  // namespace
}  // namespace trocar::control
