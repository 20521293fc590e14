// A random walk of the needle's base: in and out, reversals, sideways, turns, jumps; and what must hold after each tick of it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "common/insertion/insertion.hpp"
#include "stress.hpp"
#include "tests/reference/grid_image/grid_image.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::stress {

struct Walk {
  double jump_m{};  // once in a hundred ticks, in a random direction
  double deepest_m{0.08};
  double turn_rad{0.15};
  double sideways_m{0.004};
};

class Walker {
 public:
  Walker(std::uint64_t seed, const Walk& walk, double needle_m) : random_(seed), walk_(walk), needle_m_(needle_m) {}

  // 10 to 200 mm/s towards a place to be; there, another one. Half of them lie in front of the tissue.
  [[nodiscard]] insertion::Pose next() {
    if (left_ == 0) {
      from_ = at_;
      to_ = {random_.below(2) == 0 ? -0.01 : random_.uniform(0.0, walk_.deepest_m), random_.uniform(-walk_.sideways_m, walk_.sideways_m),
             random_.uniform(-walk_.turn_rad, walk_.turn_rad)};
      left_ = steps_ = 1 + static_cast<int>(std::abs(to_[0] - from_[0]) / (1e-5 * std::pow(20.0, random_.uniform(0.0, 1.0)))) +
                       static_cast<int>(random_.below(20));
    }
    --left_;
    const double s = 1.0 - static_cast<double>(left_) / steps_;
    for (std::size_t k = 0; k < 3; ++k) at_[k] = from_[k] + s * (to_[k] - from_[k]);
    std::array<double, 3> now = at_;
    if (walk_.jump_m > 0.0 && random_.below(100) == 0) {
      const double angle = random_.uniform(0.0, 2 * std::numbers::pi);
      now[0] += walk_.jump_m * std::cos(angle);
      now[1] += walk_.jump_m * std::sin(angle);
    }
    return {now[1], now[0] - needle_m_, std::numbers::pi / 2 + now[2]};
  }

 private:
  reference::Random random_;
  Walk walk_;
  double needle_m_;
  std::array<double, 3> at_{-0.01, 0.0, 0.0}, from_{}, to_{};  // depth of the tip, sideways, turn
  int left_{};
  int steps_{1};
};

struct Outcome {
  long ticks{};
  long not_ok{};       // solver's statuses: IllConditioned, PivotLimit
  long lost{};         // TipLost
  long withdrawals{};  // ticks at which the last contact went
  std::size_t most_contacts{};
  int most_pivots{};
  double worst_residual_n{};  // of ticks without such a status
  double worst_law_n{};       // by how much a contact breaks its own law
  double drift{};
  std::size_t allocations{};
  std::uint64_t fingerprint{};
  bool finite{true};
};

// By how much the contacts miss their bounds, or slip the wrong way (as a force over their own compliance).
[[nodiscard]] inline double breach_n(const insertion::Insertion& model, const contact::Law& law) {
  const contact::WorkingSet& set = model.working_set();
  std::array<contact::Target, capacity::contacts> bound{};
  set.set_bounds(law.shaft_n_per_m, law.tip_n_per_m, {bound.data(), set.size()});
  double worst = 0.0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const contact::Contact& c = set.solver().contact(i);
    const contact::Block own = set.solver().compliance(i, i);
    const double slip_n = c.slip_m / std::min(own[0], own[3]);
    double breach = std::max(c.axial_n - bound[i].upper_n, bound[i].lower_n - c.axial_n);
    if (c.state == contact::State::SlipForward) breach = std::max({breach, std::abs(c.axial_n - bound[i].upper_n), -slip_n});
    if (c.state == contact::State::SlipBackward) breach = std::max({breach, std::abs(c.axial_n - bound[i].lower_n), slip_n});
    if (c.state == contact::State::Stuck) breach = std::max(breach, std::abs(slip_n) * 1e-3);
    worst = std::max(worst, std::isfinite(breach) ? breach : 1e300);
  }
  return worst;
}

[[nodiscard]] inline Outcome walk_through(const model::Image& image, const Walk& walk, std::uint64_t seed, long ticks) {
  const auto model = std::make_unique<insertion::Insertion>();
  model->open(image);
  Walker walker(seed, walk, image.needle.length_m);
  Outcome outcome;
  Fingerprint bits;
  std::size_t contacts = 0;
  for (outcome.ticks = 0; outcome.ticks < ticks; ++outcome.ticks) {
    const insertion::Pose pose = walker.next();
    const std::size_t before = allocations();
    const insertion::Result result = model->step(pose, 1e-3);
    outcome.allocations += allocations() - before;
    for (const double value : {result.base.fx_n, result.base.fy_n, result.base.tau_nm, result.path_m}) {
      bits.add(value);
      outcome.finite = outcome.finite && std::isfinite(value);
    }
    const bool solved = result.status != insertion::Status::IllConditioned && result.status != insertion::Status::PivotLimit;
    if (solved) {
      outcome.worst_residual_n = std::max(outcome.worst_residual_n, result.residual_n);
      outcome.worst_law_n = std::max(outcome.worst_law_n, breach_n(*model, *image.law));
    } else {
      ++outcome.not_ok;
    }
    outcome.lost += result.status == insertion::Status::TipLost ? 1 : 0;
    outcome.most_pivots = std::max(outcome.most_pivots, result.pivots);
    outcome.most_contacts = std::max(outcome.most_contacts, model->contacts());
    outcome.withdrawals += contacts > 0 && model->contacts() == 0 ? 1 : 0;
    contacts = model->contacts();
    if (outcome.ticks % 997 == 0) outcome.drift = std::max(outcome.drift, model->working_set().solver().factor_drift());
  }
  outcome.fingerprint = bits.value();
  return outcome;
}

inline void expect_sound(const Outcome& outcome) {
  EXPECT_TRUE(outcome.finite);
  EXPECT_LE(outcome.worst_residual_n, contact::Solver::tolerance_n);
  EXPECT_LE(outcome.worst_law_n, 2e-9);
  EXPECT_LE(outcome.most_pivots, contact::Solver::max_pivots);
  EXPECT_LT(outcome.drift, 1e-9);
  EXPECT_EQ(outcome.allocations, 0u);
  EXPECT_GT(outcome.withdrawals, outcome.ticks / 20'000);
}

}  // namespace trocar::stress
