#include "tests/benchmarks/needle/thesis_figure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "common/fem/thesis_needle.hpp"
#include "common/needle/beam.hpp"
#include "common/needle/tube.hpp"
#include "tests/benchmarks/contact/timing.hpp"
#include "tests/benchmarks/needle/elastica.hpp"

namespace trocar::bench {
namespace {

using fem::ThesisNeedle;

constexpr double length = 0.15;
constexpr std::size_t fewest = 4, usual = 24;  // elements of our beam: about enough for this figure; and unless a scene says otherwise
constexpr double none = std::numeric_limits<double>::quiet_NaN();

struct Tube {
  double outer_m{};
  needle::Section section{};
};

Tube tube_20g() {
  const needle::Gauge* const gauge = needle::find_gauge("20G");
  return {gauge->outer_m, needle::section_of(gauge->outer_m, gauge->inner_m, needle::find_material("steel")->young_pa)};
}

fem::ThesisNeedleProperties printed(double depth_m) { return {.length_m = length, .depth_m = depth_m, .thickness_m = depth_m}; }

fem::ThesisNeedleProperties fitted(const Tube& tube, int elements) {
  fem::ThesisNeedleProperties p = printed(tube.outer_m);
  p.elements = elements;
  p.young_pa = fem::fitted_young_pa(p, tube.section.bending_nm2);
  return p;
}

void load(ThesisNeedle& needle, double force_n) {
  const ThesisNeedle::Force tip[] = {{length, {0.0, force_n}}};
  needle.set_forces(tip);
}

class Trial {
 public:
  Trial(FigureRow about, const needle::Vector2& exact) : row_(std::move(about)), exact_(exact) {}
  virtual ~Trial() = default;
  virtual void solve() = 0;  // from rest
  FigureRow& answer() {
    const auto [tip, converged] = tip_of();
    row_.x_m = converged ? tip[0] : none;
    row_.y_m = converged ? tip[1] : none;
    row_.error_m = std::hypot(row_.x_m - exact_[0], row_.y_m - exact_[1]);
    return row_;
  }

 protected:
  [[nodiscard]] virtual std::pair<needle::Vector2, bool> tip_of() = 0;
  FigureRow row_;

 private:
  needle::Vector2 exact_;
};

class Ours final : public Trial {
 public:
  Ours(double load_n, const Tube& tube, std::size_t elements, const needle::Vector2& exact)
      : Trial({load_n, "ours", elements}, exact), tip_{{length, {0.0, load_n}, 0.0}} {
    if (beam_->open({length, tube.section.bending_nm2, tube.section.axial_n, 0.0, elements}) != needle::Status::Ok)
      throw std::runtime_error("a beam cannot be opened");
  }
  void solve() override {
    beam_->reset();
    result_ = beam_->solve({}, tip_);
  }

 private:
  std::pair<needle::Vector2, bool> tip_of() override {
    row_.outcome = needle::to_string(result_.status);
    row_.iterations = result_.iterations;
    return {beam_->tip().position_m, result_.status == needle::Status::Ok};
  }
  std::unique_ptr<needle::Beam> beam_ = std::make_unique<needle::Beam>();
  needle::Load tip_[1];
  needle::Result result_{};
};

class Triangles final : public Trial {
 public:
  enum class By { FixedPoint, Newton, PlainNewton };
  Triangles(double load_n, const char* method, const fem::ThesisNeedleProperties& p, By by, const needle::Vector2& exact)
      : Trial({load_n, method, static_cast<std::size_t>(p.elements)}, exact), needle_(p), by_(by) {
    load(needle_, load_n);
    newton_.predicted_stress = by != By::PlainNewton;
  }
  void solve() override { result_ = by_ == By::FixedPoint ? needle_.fixed_point() : needle_.newton(newton_); }

 private:
  std::pair<needle::Vector2, bool> tip_of() override {
    row_.outcome = to_string(result_.status);
    row_.iterations = result_.iterations;
    return {needle_.tip().position_m, result_.status == ThesisNeedle::Status::Converged};
  }
  ThesisNeedle needle_;
  By by_;
  ThesisNeedle::NewtonOptions newton_{};
  ThesisNeedle::Result result_{};
};

using Trials = std::vector<std::unique_ptr<Trial>>;

std::vector<FigureRow> measured(Trials& trials, int turns) {
  std::vector<Row> rows;
  for (const auto& trial : trials) {
    rows.push_back({"", [&trial] { return timed([&trial] { trial->solve(); }); }, 60});
  }
  measure(rows, turns);
  std::vector<FigureRow> answers;
  for (std::size_t k = 0; k < trials.size(); ++k) {
    FigureRow& row = trials[k]->answer();
    row.median_s = rows[k].median_s;
    row.quartile1_s = rows[k].quartile_s[0];
    row.quartile3_s = rows[k].quartile_s[1];
    answers.push_back(row);
  }
  return answers;
}

needle::Vector2 exact_tip(double load_n, const Tube& tube) {
  const ElasticaTip tip = elastica(load_n * length * length / tube.section.bending_nm2);
  return {length * tip.x, length * tip.y};
}

// The largest load at which the fixed point converges, to 0.01 %, by bisection.
double limit_n(const fem::ThesisNeedleProperties& p) {
  ThesisNeedle needle(p);
  double low = 0.0, high = 0.5;
  while (high - low > 1e-4 * high) {
    const double middle = 0.5 * (low + high);
    load(needle, middle);
    (needle.fixed_point().status == ThesisNeedle::Status::Converged ? low : high) = middle;
  }
  return low;
}

double deflection_m(const fem::ThesisNeedleProperties& p, double load_n) {
  ThesisNeedle needle(p);
  load(needle, load_n);
  if (needle.newton().status != ThesisNeedle::Status::Converged) throw std::runtime_error("Newton's method ends below the limit");
  return needle.tip().position_m[1];
}

}  // namespace

ThesisFigure thesis_figure(int turns) {
  ThesisFigure figure;
  const Tube tube = tube_20g();
  const auto as_printed = printed(tube.outer_m);
  const auto as_fitted = fitted(tube, as_printed.elements);
  double worst_error = 0.0, slowest = std::numeric_limits<double>::infinity(), plainly = slowest, usual_slowest = slowest;
  for (const double force : {0.005, 0.01, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5}) {
    const needle::Vector2 exact = exact_tip(force, tube);
    Trials trials;
    trials.push_back(std::make_unique<Ours>(force, tube, fewest, exact));
    trials.push_back(std::make_unique<Ours>(force, tube, usual, exact));
    using By = Triangles::By;
    trials.push_back(std::make_unique<Triangles>(force, "printed, fixed point", as_printed, By::FixedPoint, exact));
    trials.push_back(std::make_unique<Triangles>(force, "printed, Newton", as_printed, By::Newton, exact));
    trials.push_back(std::make_unique<Triangles>(force, "fitted, Newton", as_fitted, By::Newton, exact));
    trials.push_back(std::make_unique<Triangles>(force, "fitted, plain Newton", as_fitted, By::PlainNewton, exact));
    const std::vector<FigureRow> rows = measured(trials, turns);
    figure.rows.push_back({force, "elastica", 0, exact[0], exact[1], 0.0, "exact"});
    figure.rows.insert(figure.rows.end(), rows.begin(), rows.end());
    if (force < 0.05) continue;  // the figure's loads; the smaller ones show the fixed point
    worst_error = std::max(worst_error, rows[0].error_m / rows[4].error_m);
    slowest = std::min(slowest, rows[4].median_s / rows[0].median_s);
    usual_slowest = std::min(usual_slowest, rows[4].median_s / rows[1].median_s);
    plainly = std::min(plainly, rows[5].median_s / rows[0].median_s);
  }
  for (const double force : {0.1, 0.3, 0.5}) {
    const needle::Vector2 exact = exact_tip(force, tube);
    Trials trials;
    for (const std::size_t elements : {2U, 4U, 8U, 16U, 24U}) trials.push_back(std::make_unique<Ours>(force, tube, elements, exact));
    for (const int elements : {8, 15, 30, 60, 120, 240})
      trials.push_back(std::make_unique<Triangles>(force, "thesis", fitted(tube, elements), Triangles::By::Newton, exact));
    for (const FigureRow& row : measured(trials, turns))
      figure.bends.push_back({"figure 5.13", row.method, row.elements, force * length * length / tube.section.bending_nm2,
                              row.error_m / length, 0.0, row.iterations, row.median_s, row.quartile1_s, row.quartile3_s});
  }
  figure.error_met = worst_error <= 1.0;
  const double limit_printed = limit_n(as_printed), limit_fitted = limit_n(as_fitted);
  figure.ratios = {{fmt::format("figure 5.13, 0.05 to 0.5 N: error of {} elements over the fitted thesis model's, worst", fewest),
                    worst_error, Ratio::Goal::AtMost, 1.0},
                   {fmt::format("its banded Newton's time over that of {} elements, least", fewest), slowest, Ratio::Goal::AtLeast, 5.0},
                   {fmt::format("the same over {} elements", usual), usual_slowest, Ratio::Goal::None, 0.0},
                   {fmt::format("with a plain Newton, over {} elements", fewest), plainly, Ratio::Goal::None, 0.0},
                   {"fitted modulus, MPa", 1e-6 * as_fitted.young_pa, Ratio::Goal::None, 0.0},
                   {"the fixed point stops converging, E as printed, N", limit_printed, Ratio::Goal::None, 0.0},
                   {"the fixed point stops converging, E fitted, N", limit_fitted, Ratio::Goal::None, 0.0},
                   {"there the tip's deflection over the needle's depth", deflection_m(as_printed, limit_printed) / tube.outer_m,
                    Ratio::Goal::None, 0.0}};
  return figure;
}

void print(const ThesisFigure& figure) {
  fmt::print("\n{:<10} {:<22} {:>8} {:>10} {:>10} {:>12} {:>14} {:>10} {:>12} {:>24}\n", "force [N]", "figure 5.13", "elements", "x [mm]",
             "y [mm]", "error [mm]", "outcome", "iterations", "median [us]", "quartiles [us]");
  for (const FigureRow& r : figure.rows)
    fmt::print("{:<10} {:<22} {:>8} {:>10.4f} {:>10.4f} {:>12.3e} {:>14} {:>10} {:>12.2f} {:>12.2f} {:>11.2f}\n", r.load_n, r.method,
               r.elements, 1e3 * r.x_m, 1e3 * r.y_m, 1e3 * r.error_m, r.outcome, r.iterations, 1e6 * r.median_s, 1e6 * r.quartile1_s,
               1e6 * r.quartile3_s);
}

void write(const std::filesystem::path& folder, const std::vector<FigureRow>& rows) {
  std::string text = "force_n,method,elements,tip_x_m,tip_y_m,error_m,outcome,iterations,median_us,quartile1_us,quartile3_us\n";
  for (const FigureRow& r : rows)
    text += fmt::format("{},\"{}\",{},{},{},{},{},{},{},{},{}\n", r.load_n, r.method, r.elements, r.x_m, r.y_m, r.error_m, r.outcome,
                        r.iterations, 1e6 * r.median_s, 1e6 * r.quartile1_s, 1e6 * r.quartile3_s);
  write_file(folder / "needle_thesis.csv", text);
}

}  // namespace trocar::bench
