// How wrong the path methods are against a conforming fine mesh, how they converge, how continuous their force is, and what a tick takes.
//   accuracy_benchmark [--out FOLDER] [--quick]      ends with 1 when the embedded method's force jumps
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "common/fem/statics.hpp"
#include "tests/benchmarks/accuracy/course.hpp"
#include "tests/benchmarks/accuracy/output.hpp"
#include "tests/benchmarks/accuracy/solid.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

using contact::Method;
constexpr Method methods[] = {Method::Snap, Method::Adapt, Method::Embedded, Method::Subdivide};

const char* element_name(fem::Type type) { return type == fem::Type::Tri3 ? "tri3" : "quad4"; }

class Bench {
 public:
  explicit Bench(const Options& options)
      : options_(options),
        paths_(paths()),
        depth_m_(options.quick ? std::vector{0.0283} : std::vector{0.0260, 0.0283, 0.0309, 0.0338}),
        sides_(options.quick ? std::vector{11, 21} : std::vector{11, 21, 41, 61, 81}) {
    if (options.quick) paths_ = {paths_[1], paths_[3]};
  }

  void references();
  void errors();
  void elements_alone();
  void solids();
  bool finish();  // whether the force is continuous

 private:
  void mesh(const Path& path, std::size_t path_index, fem::Type type, int side);
  void claims();

  Options options_;
  std::vector<Path> paths_;
  std::vector<double> depth_m_;
  std::vector<int> sides_;
  std::vector<fem::Point> places_{visible_points()};
  std::vector<std::vector<Answer>> reference_{};  // of each path, of each depth
  std::vector<ReferenceRow> reference_rows_{};
  std::vector<ErrorRow> errors_{}, alone_{};
  std::vector<CourseRow> courses_{};
  std::vector<SolidAnswer> solids_{};
  std::vector<Claim> claims_{};
};

double visible_error(const Eigen::VectorXd& u, const Eigen::VectorXd& right, const std::vector<bool>& counts) {
  double wrong = 0.0, size = 0.0;
  for (std::size_t p = 0; p < counts.size(); ++p) {
    if (!counts[p]) continue;
    const auto row = 2 * static_cast<Eigen::Index>(p);
    wrong += (u - right).segment<2>(row).squaredNorm();
    size += right.segment<2>(row).squaredNorm();
  }
  return std::sqrt(wrong / size);
}

Metrics compare(const Answer& answer, const Answer& right, const std::vector<bool>& counts) {
  const auto off = [](double value, double exact) { return std::abs(value / exact - 1.0); };
  return {off(answer.axial_n_per_m, right.axial_n_per_m),
          off(answer.lateral_n_per_m, right.lateral_n_per_m),
          visible_error(answer.axial_visible, right.axial_visible, counts),
          visible_error(answer.lateral_visible, right.lateral_visible, counts),
          visible_error(answer.slip_visible_m, right.slip_visible_m, counts),
          off(answer.slip_force_n, right.slip_force_n),
          off(answer.tip_m, right.tip_m)};
}

// Extrapolated from the two finest meshes; how much that changes from one refinement to the next is the tolerance of every error below.
void Bench::references() {
  const int finest = options_.quick ? 1 : 2;
  for (const Path& path : paths_) {
    std::vector<Answer> answers;
    ReferenceRow row{path.name, 0.0, {}};
    for (const double depth : depth_m_) {
      std::vector<bool> counts;
      for (const fem::Point& x : places_) counts.push_back(distance_to_shaft_m(path, depth, x) >= 0.0025);
      std::vector<Answer> level;
      for (int k = 0; k <= finest; ++k) level.push_back(fine_answer(path, depth, k, places_));
      const Answer& last = level.back();
      answers.push_back(extrapolated(level[level.size() - 2], last));
      const Metrics change = compare(finest > 1 ? extrapolated(level[0], level[1]) : last, answers.back(), counts);
      for (std::size_t m = 0; m < change.size(); ++m) row.change[m] = std::max(row.change[m], change[m]);
      row.slipping += last.slipping / static_cast<double>(depth_m_.size());
    }
    reference_.push_back(answers);
    reference_rows_.push_back(row);
  }
}

void Bench::mesh(const Path& path, std::size_t path_index, fem::Type type, int side) {
  const scene::Scene scene = block_scene(type, side, path);
  const Compiled compiled(scene);
  const double h_m = side_m / (side - 1);
  for (const Method method : methods) {
    if (method == Method::Subdivide && type != fem::Type::Tri3) continue;
    ErrorRow row{path.name, element_name(type), side, name_of(method), {}, {}, 0.0, 0, {}};
    double tick_us = 0.0;
    for (std::size_t k = 0; k < depth_m_.size(); ++k) {
      const double depth = depth_m_[k];
      std::vector<bool> counts;
      for (const fem::Point& x : places_) counts.push_back(distance_to_shaft_m(path, depth, x) >= 2.0 * h_m);
      std::optional<Compiled> own;
      if (method == Method::Subdivide) own.emplace(subdivided(scene, path, depth));
      const Asked asked = coarse_answer(own ? *own : compiled, method, path, depth, places_);
      const Answer& right = reference_[path_index][k];
      const Metrics off = compare(asked.answer, right, counts);
      for (std::size_t m = 0; m < off.size(); ++m) row.error[m] += off[m] * off[m] / static_cast<double>(depth_m_.size());
      row.answer = asked.answer;
      row.contacts = std::max(row.contacts, asked.contacts);
      row.status = std::max(row.status, asked.status);
      // An offline method cannot grow with the needle: its tick is one with all of its contacts.
      if (method == Method::Subdivide && k + 1 == depth_m_.size()) tick_us = push_explicit_us(*own, path, depth);
    }
    for (double& each : row.error) each = std::sqrt(each);
    if (method != Method::Subdivide) {
      const Course course = insert(compiled, method, path, depth_m_.back());
      courses_.push_back({row.path, row.element, side, row.method, course});
      tick_us = course.median_us;
    }
    row.tick_us = tick_us;
    errors_.push_back(row);
  }
}

void Bench::errors() {
  for (std::size_t p = 0; p < paths_.size(); ++p)
    for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4})
      for (const int side : sides_) mesh(paths_[p], p, type, side);
  claims();
}

// One for each figure, over the meshes and paths of one element type, in geometric means.
void Bench::claims() {
  for (const char* element : {"tri3", "quad4"})
    for (std::size_t m = 0; m < metric_name.size(); ++m)
      for (const bool oblique : {false, true}) {
        double embedded = 0.0, adapt = 0.0, snap = 0.0, count = 0.0, tolerance = 0.0;
        for (const ReferenceRow& row : reference_rows_)
          if (row.path.starts_with("oblique") == oblique) tolerance = std::max(tolerance, row.change[m]);
        for (const ErrorRow& row : errors_) {
          if (row.element != element || row.path.starts_with("oblique") != oblique) continue;
          const double log_error = std::log(row.error[m]);
          if (row.method == "embedded") embedded += log_error, count += 1.0;
          if (row.method == "adapt") adapt += log_error;
          if (row.method == "snap") snap += log_error;
        }
        claims_.push_back({element, oblique ? "oblique" : "straight", metric_name[m], std::exp(embedded / count), std::exp(adapt / count),
                           std::exp(snap / count), tolerance});
      }
}

// What elements are wrong by of themselves, wherever a path runs: the reference's own forces are put on the mesh. A path method that takes
// all forces exactly sees as much.
void Bench::elements_alone() {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4})
    for (const int side : sides_)
      for (std::size_t p = 0; p < paths_.size(); ++p) {
        if (!paths_[p].name.starts_with("oblique")) continue;
        const fem::Mesh mesh = fem::make_mesh(block_scene(type, side, paths_[p]).tissue);
        const fem::Statics statics(mesh, block_tissue());
        const fem::Locator locator(mesh);
        ErrorRow row{paths_[p].name, element_name(type), side, "alone", {}, {}, 0.0, 0, {}};
        for (std::size_t k = 0; k < depth_m_.size(); ++k) {
          const Answer& right = reference_[p][k];
          std::vector<bool> counts;
          for (const fem::Point& x : places_) counts.push_back(distance_to_shaft_m(paths_[p], depth_m_[k], x) >= 2.0 * side_m / (side - 1));
          Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(statics.degrees_of_freedom(), 3);
          for (std::size_t i = 0; i < right.shaft_m.size(); ++i) {
            const std::optional<fem::Embedding> at = locator.locate(right.shaft_m[i]);
            if (!at) throw std::logic_error("the shaft leaves the mesh");
            for (int n = 0; n < at->count; ++n)
              loads.middleRows<2>(2 * at->node[static_cast<std::size_t>(n)]) +=
                  at->weight[static_cast<std::size_t>(n)] * right.force_n.middleRows<2>(2 * static_cast<Eigen::Index>(i));
          }
          const Eigen::MatrixXd u = statics.solve(loads);
          const Eigen::VectorXd* visible[] = {&right.axial_visible, &right.lateral_visible, &right.slip_visible_m};
          for (int column = 0; column < 3; ++column) {
            const double off = visible_error(displacement_at(locator, u.col(column), places_), *visible[column], counts);
            row.error[static_cast<std::size_t>(first_visible + column)] += off * off / static_cast<double>(depth_m_.size());
          }
        }
        for (double& each : row.error) each = std::sqrt(each);
        alone_.push_back(row);
      }
}

void Bench::solids() {
  for (const double ratio : options_.quick ? std::vector{0.5, 1.0} : std::vector{0.5, 1.0, 2.0, 4.0}) {
    fmt::print(stderr, "  radius / element size {} …\n", ratio);
    solids_.push_back(solid_answer(ratio));
  }
}

bool Bench::finish() {
  print(reference_rows_);
  print(errors_);
  print(claims_);
  print_alone(alone_, errors_);
  print_convergence(errors_, solids_);
  const double worst_mn = print(courses_);
  write(options_.out, reference_rows_, errors_, courses_, solids_);
  fmt::print("\nforce continuity, embedded, every mesh and path: worst {:.3g} mN over 0.1 mm (goal 25): {}\n", worst_mn,
             worst_mn <= 25.0 ? "met" : "MISSED");
  fmt::print("tables and figures: {}\n", options_.out.string());
  return worst_mn <= 25.0;
}

int run(const Options& options) {
  Bench bench(options);
  const auto step = [](const char* what, const std::function<void()>& work) { bench::step("accuracy_benchmark", what, work); };
  step("fine conforming meshes", [&] { bench.references(); });
  step("path methods", [&] { bench.errors(); });
  step("elements alone", [&] { bench.elements_alone(); });
  step("a solid", [&] { bench.solids(); });
  return bench.finish() ? 0 : 1;
}

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program("accuracy_benchmark", count, argument, trocar::bench::run); }
