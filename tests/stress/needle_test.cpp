// A needle that bends, beyond what it is made for: buckling, far too soft, far too stiff, turned around, pushed against what does not give.
// After every tick: numbers, a status with a name, and where that says solved, a residual, a balance and forces that hold. In a loop of the
// base the work of the base is what tissue and needle store and friction takes: the solver adds none.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/needle/tube.hpp"
#include "walk.hpp"

namespace trocar::stress {
namespace {

using insertion::Insertion;
using insertion::Pose;
using insertion::Result;
using insertion::Status;

constexpr double tissue_pa = 25.3e3;
constexpr double steel_pa = 200e9;
constexpr double half_turn_rad = std::numbers::pi;

[[nodiscard]] needle::Section tube_20g(double young_pa = steel_pa) { return needle::section_of(0.908e-3, 0.603e-3, young_pa); }
[[nodiscard]] needle::Section tube_22g(double young_pa = steel_pa) { return needle::section_of(0.718e-3, 0.413e-3, young_pa); }

const reference::GridImage& soft() {
  static const reference::GridImage grid({.element = fem::Type::Tri3});
  return grid;
}

struct Seen {
  long ticks{}, unsolved{}, not_converged{}, geometry{};  // geometry: solved, but the path has trouble
  long in_a_row{}, longest{};                             // unsolved
  double residual_n{};                                    // from here on, of solved ticks
  double balance{};                                       // base wrench against the clamp's reaction, N and N m
  double breach_n{};                                      // of the bounds
  std::size_t most_contacts{}, allocations{};
  bool finite{true}, named{true};
};

class Steered {
 public:
  Steered(const reference::GridImage& grid, const contact::Law& law, const needle::Section& section) : law_(law), image_(grid.image()) {
    image_.law = &law_;
    image_.needle.elements = 24;
    image_.needle.bending_nm2 = section.bending_nm2;
    image_.needle.axial_n = section.axial_n;
    model_->open(image_);
  }
  Steered(const Steered&) = delete;
  Steered& operator=(const Steered&) = delete;

  const Result& to(const Pose& pose) {
    const std::size_t before = allocations();
    result_ = model_->step(pose, 1e-3);
    seen_.allocations += allocations() - before;
    pose_ = pose;
    look();
    return result_;
  }
  // In steps of at most step_m, or as much at the end of the needle.
  void move_to(const Pose& goal, double step_m = 5e-5) {
    const Pose from = pose_;
    const double way_m = std::hypot(goal.x_m - from.x_m, goal.y_m - from.y_m) + needle_m() * std::abs(goal.theta_rad - from.theta_rad);
    const int steps = std::max(1, static_cast<int>(std::ceil(way_m / step_m)));
    for (int k = 1; k <= steps; ++k) {
      const double s = static_cast<double>(k) / steps;
      to({std::lerp(from.x_m, goal.x_m, s), std::lerp(from.y_m, goal.y_m, s), std::lerp(from.theta_rad, goal.theta_rad, s)});
    }
  }
  void by(double dx_m, double dy_m, double turn_rad = 0.0, double step_m = 5e-5) {
    move_to({pose_.x_m + dx_m, pose_.y_m + dy_m, pose_.theta_rad + turn_rad}, step_m);
  }

  [[nodiscard]] const Result& result() const { return result_; }
  [[nodiscard]] const Seen& seen() const { return seen_; }
  [[nodiscard]] const Pose& pose() const { return pose_; }
  [[nodiscard]] const Insertion& model() const { return *model_; }
  [[nodiscard]] double needle_m() const { return image_.needle.length_m; }
  [[nodiscard]] double buckling_n() const {
    return std::numbers::pi * std::numbers::pi * image_.needle.bending_nm2 / (4 * needle_m() * needle_m());
  }

  // Strain energy of the needle, Pi + sum f.(r - b) (needle/beam.hpp), and of the tissue and its ties, f.G f / 2.
  [[nodiscard]] double stored_j() const {
    const contact::WorkingSet& set = model_->working_set();
    if (set.size() == 0) return 0.0;
    double sum = model_->beam().energy_j();
    for (std::size_t i = 0; i < set.size(); ++i) {
      const contact::Vector2& f = set.solver().contact(i).force_n;
      const contact::Vector2 u = set.solver().displacement_m(i);
      const contact::Vector2 r = model_->beam().position_m(i);
      sum += 0.5 * (f[0] * u[0] + f[1] * u[1]) - f[0] * (r[0] - pose_.x_m) - f[1] * (r[1] - pose_.y_m);
    }
    return sum;
  }
  [[nodiscard]] double taken_by_friction_j() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < model_->contacts(); ++i) {
      const contact::Contact& c = model_->working_set().solver().contact(i);
      if (c.state != contact::State::Stuck) sum += c.axial_n * c.slip_m;
    }
    return sum;
  }

 private:
  void look() {
    ++seen_.ticks;
    for (const double value : {result_.base.fx_n, result_.base.fy_n, result_.base.tau_nm, result_.tip.x_m, result_.tip.y_m,
                               result_.tip.theta_rad, result_.path_m})
      seen_.finite = seen_.finite && std::isfinite(value);
    for (std::size_t i = 0; i < model_->contacts(); ++i) {
      const Insertion::ContactReport c = model_->contact(i);
      for (const double value : {c.position_m[0], c.position_m[1], c.arclength_m, c.axial_n, c.lateral_n})
        seen_.finite = seen_.finite && std::isfinite(value);
    }
    seen_.finite = seen_.finite && !std::isnan(result_.residual_n);  // infinite where there is no solution
    seen_.named = seen_.named && result_.status < Status::OffShaft;  // every pose and time step here is finite
    seen_.most_contacts = std::max(seen_.most_contacts, model_->contacts());
    seen_.not_converged += result_.status == Status::NotConverged ? 1 : 0;
    seen_.geometry += result_.status != Status::Ok && result_.status <= Status::TipLost ? 1 : 0;
    if (result_.status > Status::TipLost) {
      ++seen_.unsolved;
      seen_.longest = std::max(seen_.longest, ++seen_.in_a_row);
      return;
    }
    seen_.in_a_row = 0;
    if (model_->contacts() == 0) return;
    seen_.residual_n = std::max(seen_.residual_n, result_.residual_n);
    const insertion::Wrench clamp = model_->beam().reaction();
    seen_.balance = std::max({seen_.balance, std::abs(clamp.fx_n - result_.base.fx_n), std::abs(clamp.fy_n - result_.base.fy_n),
                              std::abs(clamp.tau_nm - result_.base.tau_nm)});
    const contact::WorkingSet& set = model_->working_set();
    std::array<contact::Target, capacity::contacts> bound{};
    set.set_bounds(law_.shaft_n_per_m, law_.tip_n_per_m, {bound.data(), set.size()});
    for (std::size_t i = 0; i < set.size(); ++i) {
      const contact::Contact& c = set.solver().contact(i);
      seen_.breach_n = std::max({seen_.breach_n, c.axial_n - bound[i].upper_n, bound[i].lower_n - c.axial_n});
      if (c.state == contact::State::SlipForward) seen_.breach_n = std::max(seen_.breach_n, bound[i].upper_n - c.axial_n);
      if (c.state == contact::State::SlipBackward) seen_.breach_n = std::max(seen_.breach_n, c.axial_n - bound[i].lower_n);
    }
  }

  contact::Law law_;
  model::Image image_;
  std::unique_ptr<Insertion> model_{std::make_unique<Insertion>()};
  Result result_{};
  Pose pose_{};
  Seen seen_{};
};

void expect_sound(const Seen& seen, const std::string& name) {
  EXPECT_TRUE(seen.finite);
  EXPECT_TRUE(seen.named);
  EXPECT_LE(seen.residual_n, 1e-9);
  EXPECT_LE(seen.balance, 1e-9);
  EXPECT_LE(seen.breach_n, 1e-9);
  EXPECT_EQ(seen.allocations, 0U);
  ::testing::Test::RecordProperty(name + "_ticks", std::to_string(seen.ticks));
  ::testing::Test::RecordProperty(name + "_not_converged", std::to_string(seen.not_converged));
  ::testing::Test::RecordProperty(name + "_unsolved", std::to_string(seen.unsolved));
  ::testing::Test::RecordProperty(name + "_longest", std::to_string(seen.longest));
  ::testing::Test::RecordProperty(name + "_path_trouble", std::to_string(seen.geometry));
}

void steer(Steered& needle, const Walk& walk, std::uint64_t seed, long ticks) {
  Walker walker(seed, walk, needle.needle_m());
  for (long k = 0; k < ticks; ++k) needle.to(walker.next());
}

// 10 to 200 mm/s, in and out: what people steer.
constexpr Walk ordinary{.turn_rad = 0.05, .sideways_m = 0.002};

TEST(NeedleStress, OrdinarySteeringConvergesInEveryTick) {
  for (const auto& [name, section] : {std::pair{"20g", tube_20g()}, {"22g", tube_22g()}}) {
    SCOPED_TRACE(name);
    Steered needle(soft(), soft().law, section);
    steer(needle, ordinary, 3, counts(20'000, 1'000'000));
    expect_sound(needle.seen(), name);
    EXPECT_EQ(needle.seen().unsolved, 0);
    EXPECT_GT(needle.seen().most_contacts, 8U);
  }
}

// Three times the angle, twice the way aside, and jumps of a millimetre.
TEST(NeedleStress, HardSteering) {
  for (const double jump_m : {0.0, 1e-3}) {
    SCOPED_TRACE(jump_m);
    Steered needle(soft(), soft().law, tube_22g());
    steer(needle, {.jump_m = jump_m}, 4, counts(10'000, 500'000));
    expect_sound(needle.seen(), jump_m > 0.0 ? "jumps" : "smooth");
    EXPECT_EQ(needle.seen().unsolved, 0);
  }
}

TEST(NeedleStress, StiffnessFromFarBelowTheTissuesToFarAboveSteel) {
  for (int decade = -4; decade <= 8; ++decade) {
    SCOPED_TRACE("1e" + std::to_string(decade));
    Steered needle(soft(), soft().law, tube_22g(std::pow(10.0, decade) * tissue_pa));
    steer(needle, ordinary, 5, counts(3'000, 100'000));
    expect_sound(needle.seen(), "ratio_1e" + std::to_string(decade));
    // Steel is at 8e6. Softer needles snap from one equilibrium to another, and of those ticks some find none.
    EXPECT_LE(needle.seen().unsolved, decade >= 7 ? 0 : needle.seen().ticks / 500);
  }
}

// Friction that takes several times the thrust, and then tens of times, at which the needle would buckle in the air.
TEST(NeedleStress, ThrustFarBeyondBuckling) {
  for (const double density : {1.0, 3.0, 10.0}) {
    SCOPED_TRACE(density);
    contact::Law law = soft().law;
    law.shaft_n_per_m *= density;
    law.tip_n_per_m *= density;
    Steered needle(soft(), law, tube_22g());
    needle.to({0.0013, -0.005 - needle.needle_m(), std::numbers::pi / 2});
    double most_n = 0.0;
    for (long round = 0; round < counts(2, 50); ++round) {
      needle.by(0.0, 0.075);
      most_n = std::max(most_n, needle.result().base.fy_n);
      needle.by(0.003, 0.0, -0.02);
      needle.by(-0.003, 0.0, 0.02);
      needle.by(0.0, -0.075);
    }
    expect_sound(needle.seen(), "density_" + std::to_string(static_cast<int>(density)));
    EXPECT_GT(most_n, 2.0 * needle.buckling_n());
    EXPECT_LE(needle.seen().unsolved, density < 10.0 ? 0 : needle.seen().ticks / 100);
  }
}

// The tip sits in tissue a million times stiffer and cannot slip; the base comes on by a centimetre.
TEST(NeedleStress, TipAgainstARigidInclusion) {
  reference::Block block{.element = fem::Type::Tri3};
  block.zones = {{{tissue_pa, 0.48}, {}, {}}, {{1e6 * tissue_pa, 0.48}, fem::Box{{-1.0, 0.03, -1.0}, {1.0, 0.05, 1.0}}, {}}};
  const reference::GridImage grid(block);
  contact::Law law = grid.law;
  for (std::size_t i = 0; i < 5; ++i) {
    law.explicit_point_m[i] = {0.0013, 0.005 + 0.006 * static_cast<double>(i)};
    law.explicit_slip_force_n[i] = 0.2;
  }
  law.explicit_point_m[5] = {0.0013, 0.04};
  law.explicit_slip_force_n[5] = 1e3;
  law.explicit_count = 6;
  Steered needle(grid, law, tube_22g());
  ASSERT_EQ(needle.to({0.0013, 0.04 - needle.needle_m(), std::numbers::pi / 2}).status, Status::Ok);
  needle.by(1e-5, 0.0);  // buckles to one side
  double most_n = 0.0;
  for (long round = 0; round < counts(3, 200); ++round) {
    needle.by(0.0, 0.01);
    most_n = std::max(most_n, needle.result().base.fy_n);
    needle.by(0.004, 0.0, -0.1);
    needle.by(-0.008, 0.0, 0.2);
    needle.by(0.004, 0.0, -0.1);
    needle.by(0.0, -0.01);
  }
  expect_sound(needle.seen(), "inclusion");
  EXPECT_GT(most_n, needle.buckling_n());
  EXPECT_EQ(needle.seen().unsolved, 0);
}

TEST(NeedleStress, HalfATurnInTheAir) {
  Steered needle(soft(), soft().law, tube_22g());
  const Pose ahead{0.001, -0.02 - needle.needle_m(), std::numbers::pi / 2};
  const auto expect_straight = [&] {
    EXPECT_EQ(needle.result().status, Status::Ok);
    EXPECT_EQ(needle.result().contacts, 0U);
    EXPECT_EQ(std::abs(needle.result().base.fx_n) + std::abs(needle.result().base.fy_n) + std::abs(needle.result().base.tau_nm), 0.0);
    EXPECT_NEAR(needle.result().tip.x_m, needle.pose().x_m + needle.needle_m() * std::cos(needle.pose().theta_rad), 1e-14);
    EXPECT_NEAR(needle.result().tip.y_m, needle.pose().y_m + needle.needle_m() * std::sin(needle.pose().theta_rad), 1e-14);
  };
  for (const double step_rad : {half_turn_rad, half_turn_rad / 7, 1e-3}) {
    needle.to(ahead);
    for (const double sign : {1.0, 1.0, -1.0, -1.0, -1.0, 1.0}) {
      const double goal = needle.pose().theta_rad + sign * half_turn_rad;
      while (std::abs(goal - needle.pose().theta_rad) > 0.5 * step_rad) {
        Pose pose = needle.pose();
        pose.theta_rad += sign * step_rad;
        needle.to(pose);
        expect_straight();
      }
    }
    needle.to(ahead);
    needle.by(0.0, 0.06);
    EXPECT_GT(needle.result().contacts, 5U);
    EXPECT_EQ(needle.result().status, Status::Ok);
    needle.by(0.0, -0.06);
    expect_straight();
  }
  expect_sound(needle.seen(), "turn");
  EXPECT_EQ(needle.seen().unsolved, 0);
}

TEST(NeedleStress, InsertionOfNoLength) {
  Steered needle(soft(), soft().law, tube_22g());
  reference::Random random(6);
  for (const double deep_m : {0.0, 1e-300, 1e-15, 1e-12, 1e-9, 1e-6, 1e-5}) {
    // The path follows the tip at the start of the next tick.
    for (int k = 0; k < 2; ++k) needle.to({0.0013, -0.001 - needle.needle_m(), std::numbers::pi / 2});
    EXPECT_EQ(needle.result().contacts, 0U);
    for (long k = 0; k < counts(300, 10'000); ++k)
      needle.to({0.0013 + random.uniform(-1e-6, 1e-6), random.uniform(-deep_m, deep_m) - needle.needle_m(),
                 std::numbers::pi / 2 + random.uniform(-1e-5, 1e-5)});
    EXPECT_LT(std::abs(needle.result().base.fy_n), 68.0 * 2e-5 + 1e-9);
  }
  expect_sound(needle.seen(), "touch");
  EXPECT_EQ(needle.seen().unsolved, 0);
}

// Out of the tissue nothing is left of what was done in it.
TEST(NeedleStress, FullWithdrawalLeavesNothing) {
  const auto stroke = [](Steered& needle) {
    needle.by(0.0, 0.045);
    needle.by(0.002, 0.01, -0.03);
    return std::array{needle.result().base.fx_n, needle.result().base.fy_n, needle.result().base.tau_nm};
  };
  const Pose ahead{0.001, -0.005 - soft().image().needle.length_m, std::numbers::pi / 2};
  for (const auto& [name, section] : {std::pair{"20g", tube_20g()}, {"22g", tube_22g()}}) {
    SCOPED_TRACE(name);
    Steered fresh(soft(), soft().law, section);
    fresh.to(ahead);
    const auto expected = stroke(fresh);
    Steered used(soft(), soft().law, section);
    for (long round = 0; round < counts(3, 100); ++round) {
      used.to(ahead);
      const auto now = stroke(used);
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(now[k], expected[k], 1e-9);
      used.by(0.0, -0.03);
      used.by(-0.002, -0.04, 0.03);
      EXPECT_EQ(used.result().contacts, 0U);
      EXPECT_EQ(used.result().base.fy_n, 0.0);
      EXPECT_NEAR(used.model().beam().energy_j(), 0.0, 1e-15);
    }
    expect_sound(used.seen(), name);
    EXPECT_EQ(used.seen().unsolved, 0);
  }
}

struct Loop {
  double work_j{};      // of the base, trapezoids
  double passed_j{};    // the same without signs
  double stored_j{};    // change over the loop
  double friction_j{};  // taken
};

// Once around, `steps` ticks: aside, in and out, turning twice.
Loop go_round(Steered& needle, double aside_m, double along_m, double turn_rad, int steps) {
  Loop loop;
  const Pose from = needle.pose();
  const double before_j = needle.stored_j();
  Result last = needle.result();
  for (int k = 1; k <= steps; ++k) {
    const double phase = k == steps ? 0.0 : 2 * std::numbers::pi * k / steps;
    const Pose at = needle.pose();
    const Result& now = needle.to({from.x_m + aside_m * std::sin(phase), from.y_m + along_m * (1.0 - std::cos(phase)),
                                   from.theta_rad + turn_rad * std::sin(2 * phase)});
    const double work_j = 0.5 * ((last.base.fx_n + now.base.fx_n) * (needle.pose().x_m - at.x_m) +
                                 (last.base.fy_n + now.base.fy_n) * (needle.pose().y_m - at.y_m) +
                                 (last.base.tau_nm + now.base.tau_nm) * (needle.pose().theta_rad - at.theta_rad));
    loop.work_j += work_j;
    loop.passed_j += std::abs(work_j);
    loop.friction_j += needle.taken_by_friction_j();
    last = now;
  }
  loop.stored_j = needle.stored_j() - before_j;
  return loop;
}

contact::Law eight_points(double slip_force_n) {
  contact::Law law = soft().law;
  law.explicit_count = 8;
  for (std::size_t i = 0; i < 8; ++i) {
    law.explicit_point_m[i] = {0.0, 0.004 + 0.006 * static_cast<double>(i)};
    law.explicit_slip_force_n[i] = slip_force_n;
  }
  return law;
}

// Contacts that stay: the balance closes, to the trapezoids' error. Without friction, or without slip, nothing is left of the work.
TEST(NeedleStress, ALoopOfTheBaseCostsWhatFrictionTakes) {
  for (const auto& [name, section] : {std::pair{"20g", tube_20g()}, {"22g", tube_22g()}}) {
    for (const double slip_force_n : {0.0, 0.02, 0.2, 1e9}) {
      SCOPED_TRACE(std::string(name) + ", slip force " + std::to_string(slip_force_n) + " N");
      Steered needle(soft(), eight_points(slip_force_n), section);
      ASSERT_EQ(needle.to({0.0, -0.05, std::numbers::pi / 2}).status, Status::Ok);
      const int steps = static_cast<int>(counts(2'000, 20'000));
      for (int round = 0; round < 3; ++round) {
        const Loop loop = go_round(needle, 0.002, 0.003, 0.02, steps);
        const double error_j = loop.work_j - loop.stored_j - loop.friction_j;
        EXPECT_GT(loop.passed_j, 1e-6);
        EXPECT_GE(loop.friction_j, 0.0);
        EXPECT_GE(loop.work_j, loop.stored_j - 1e-5 * loop.passed_j);
        EXPECT_NEAR(error_j, 0.0, 1e-5 * loop.passed_j);
        if (slip_force_n == 0.0 || slip_force_n == 1e9) {
          EXPECT_NEAR(loop.work_j, 0.0, 1e-7 * loop.passed_j);
        }
      }
      expect_sound(needle.seen(), std::string(name) + "_points");
      EXPECT_EQ(needle.seen().unsolved, 0);
    }
  }
}

// Contacts that come and go with the tip.
TEST(NeedleStress, ALoopOfTheBaseInTissueGivesNoEnergy) {
  for (const auto& [name, section] : {std::pair{"20g", tube_20g()}, {"22g", tube_22g()}}) {
    SCOPED_TRACE(name);
    Steered needle(soft(), soft().law, section);
    needle.to({0.001, -0.005 - needle.needle_m(), std::numbers::pi / 2});
    needle.by(0.0, 0.05);
    reference::Random random(8);
    for (long round = 0; round < counts(10, 200); ++round) {
      const Loop loop = go_round(needle, random.uniform(-0.003, 0.003), random.uniform(-0.004, 0.004), random.uniform(-0.03, 0.03), 2'000);
      EXPECT_GE(loop.friction_j, 0.0);
      EXPECT_GE(loop.work_j, loop.stored_j - 1e-3 * loop.passed_j);
    }
    expect_sound(needle.seen(), std::string(name) + "_tissue");
    EXPECT_EQ(needle.seen().unsolved, 0);
  }
}

TEST(NeedleStress, SameInputsGiveTheSameBits) {
  const auto run = [] {
    Steered needle(soft(), soft().law, tube_22g());
    Walker walker(9, ordinary, needle.needle_m());
    Fingerprint bits;
    for (int k = 0; k < 3000; ++k) {
      const Result& now = needle.to(walker.next());
      for (const double value : {now.base.fx_n, now.base.fy_n, now.base.tau_nm, now.tip.x_m}) bits.add(value);
    }
    return bits.value();
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace trocar::stress
