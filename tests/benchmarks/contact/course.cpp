#include "tests/benchmarks/contact/course.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/benchmarks/contact/timing.hpp"

namespace trocar::bench {
namespace {

constexpr double shaft_n_per_m = 34.0;
constexpr double entry_y_m = -0.05;
constexpr double back_m = 0.03;  // the base stands this far before the entry
constexpr double turn_rad = 0.02;
constexpr double turn_ticks = 500.0;  // 2 Hz at 1 kHz, at most 0.25 mrad a tick
constexpr long entering_ticks = 200;
constexpr double entering_m = 1e-4;  // a tick, until all contacts slip
constexpr double stroke_m = 8e-3;    // to either side over 2000 ticks, at most 25 mm/s: every contact sticks and slips
constexpr double advance_m = 1e-5;   // a tick, 10 mm/s

}  // namespace

Course::Course(const Scene& scene, Motion motion) : motion_(motion), entry_x_m_(scene.entry_x_m), depth_m_(scene.depth_m) {
  const double threshold_n = shaft_n_per_m * depth_m_ / static_cast<double>(scene.contacts);
  for (std::size_t i = 0; i < scene.contacts; ++i) {
    double lower_n = -threshold_n, upper_n = i + 1 == scene.contacts ? 2.0 * threshold_n : threshold_n;
    if (motion == Motion::TurnStuck || (motion == Motion::TurnHalf && i % 2 == 0)) upper_n = 1e3, lower_n = -1e3;
    if (motion == Motion::TurnHalf && i % 2 == 1) lower_n = upper_n = threshold_n;
    needle_.add(scene.point[i], pose(0), lower_n, upper_n);
  }
  needle_.move_to(pose(0));
}

reference::Pose Course::pose(long tick) const {
  const double phase = 2.0 * std::numbers::pi * static_cast<double>(tick) / turn_ticks;
  double turn = 0.0, along_m = 0.0;
  switch (motion_) {
    case Motion::TurnAndAdvance:
      turn = turn_rad * std::sin(phase);
      [[fallthrough]];
    case Motion::Advance:
      along_m = entering_m * static_cast<double>(std::min(tick, entering_ticks)) +
                advance_m * static_cast<double>(std::max(0L, tick - entering_ticks));
      break;
    case Motion::TurnStuck:
    case Motion::TurnHalf:
      turn = turn_rad * std::sin(phase);
      along_m = 1e-3;
      break;
    case Motion::TurnToAndFro:
      turn = turn_rad * std::sin(phase);
      [[fallthrough]];
    case Motion::ToAndFro:
      along_m = stroke_m * std::sin(phase / 4.0);
      break;
    case Motion::Rest:
      turn = 0.5 * turn_rad;
      along_m = 1e-3;
      break;
  }
  const double theta = std::numbers::pi / 2 + turn;
  return {entry_x_m_ + (along_m - back_m) * std::cos(theta), entry_y_m + (along_m - back_m) * std::sin(theta), theta};
}

const std::vector<reference::Contact>& Course::next() { return needle_.move_to(pose(++tick_)); }

std::vector<contact::Block> our_row(const Eigen::MatrixXd& g, std::size_t contact) {
  std::vector<contact::Block> row;
  for (const Eigen::Matrix2d& b : thesis_row(g, contact)) row.push_back({b(0, 0), b(0, 1), b(1, 0), b(1, 1)});
  return row;
}

std::vector<Eigen::Matrix2d> thesis_row(const Eigen::MatrixXd& g, std::size_t contact) {
  std::vector<Eigen::Matrix2d> row;
  for (std::size_t j = 0; j <= contact; ++j)
    row.emplace_back(g.block<2, 2>(static_cast<Eigen::Index>(2 * contact), static_cast<Eigen::Index>(2 * j)));
  return row;
}

Ours::Ours(const Scene& scene, Motion motion) : course_(scene, motion), target_(scene.contacts) {
  for (std::size_t i = 0; i < scene.contacts; ++i) {
    last_row_ = our_row(scene.compliance, i);
    solver_->push(last_row_);
  }
  for (long k = 0; k < 2 * entering_ticks; ++k) tick();
  pivots_ = ticks_ = 0;
}

void Ours::take(const std::vector<reference::Contact>& from) {
  targets_ = &from;
  for (std::size_t i = 0; i < from.size(); ++i) target_[i] = {from[i].tangent, from[i].gap_m, from[i].lower_n, from[i].upper_n};
}

void Ours::finish(const contact::Solution& solution) {
  if (solution.status != contact::SolverStatus::Ok) throw std::runtime_error("the contact solver did not reach its tolerance");
  worst_residual_n_ = std::max(worst_residual_n_, solution.residual_n);
  pivots_ += solution.pivots;
  ++ticks_;
  for (std::size_t i = 0; i < solver_->size(); ++i)
    if (solver_->contact(i).state != contact::State::Stuck) course_.slipped(i, solver_->contact(i).slip_m);
}

double Ours::tick() {
  take(course_.next());
  contact::Solution solution;
  const double seconds = timed([&] { solution = solver_->solve(target_); });
  finish(solution);
  return seconds;
}

double Ours::tick_that_gains() {
  solver_->pop();
  static_cast<void>(solver_->solve(std::span(target_).first(target_.size() - 1)));
  take(course_.next());
  contact::Solution solution;
  const double seconds = timed([&] {
    solver_->push(last_row_);
    solution = solver_->solve(target_);
  });
  finish(solution);
  return seconds;
}

double Ours::slipping() const {
  double count = 0.0;
  for (std::size_t i = 0; i < solver_->size(); ++i) count += solver_->contact(i).state == contact::State::Stuck ? 0.0 : 1.0;
  return count / static_cast<double>(solver_->size());
}

std::vector<reference::Axial> Ours::states() const {
  std::vector<reference::Axial> state;
  for (std::size_t i = 0; i < solver_->size(); ++i) {
    const contact::State now = solver_->contact(i).state;
    state.push_back(now == contact::State::Stuck         ? reference::Axial::Stuck
                    : now == contact::State::SlipForward ? reference::Axial::Upper
                                                         : reference::Axial::Lower);
  }
  return state;
}

Eigen::VectorXd Ours::force_n() const {
  Eigen::VectorXd f(static_cast<Eigen::Index>(2 * solver_->size()));
  for (std::size_t i = 0; i < solver_->size(); ++i)
    f.segment<2>(static_cast<Eigen::Index>(2 * i)) << solver_->contact(i).force_n[0], solver_->contact(i).force_n[1];
  return f;
}

Thesis::Thesis(const Scene& scene, Motion motion) : course_(scene, motion) {
  for (std::size_t i = 0; i < scene.contacts; ++i) {
    last_row_ = thesis_row(scene.compliance, i);
    if (!solver_->append(last_row_, course_.first_target(i))) throw std::runtime_error("the scene has more contacts than the capacity");
  }
  for (long k = 0; k < 2 * entering_ticks; ++k) tick();
}

double Thesis::tick() {
  targets_ = &course_.next();
  const double seconds = timed([&] { solver_->solve(*targets_); });
  for (std::size_t i = 0; i < solver_->size(); ++i) course_.slipped(i, solver_->slip_m(i));
  return seconds;
}

double Thesis::tick_that_gains() {
  targets_ = &course_.next();
  solver_->pop();
  const double seconds = timed([&] {
    static_cast<void>(solver_->append(last_row_, targets_->back()));
    solver_->solve(*targets_);
  });
  for (std::size_t i = 0; i < solver_->size(); ++i) course_.slipped(i, solver_->slip_m(i));
  return seconds;
}

double Thesis::slipping() const {
  double count = 0.0;
  for (std::size_t i = 0; i < solver_->size(); ++i) count += solver_->state(i) == reference::Axial::Stuck ? 0.0 : 1.0;
  return count / static_cast<double>(solver_->size());
}

Eigen::VectorXd Thesis::force_n() const {
  Eigen::VectorXd f(static_cast<Eigen::Index>(2 * solver_->size()));
  for (std::size_t i = 0; i < solver_->size(); ++i) f.segment<2>(static_cast<Eigen::Index>(2 * i)) = solver_->force_n(i);
  return f;
}

}  // namespace trocar::bench
