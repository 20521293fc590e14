#include "tests/benchmarks/accuracy/solid.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/scene/spacing.hpp"
#include "tests/benchmarks/accuracy/method.hpp"

namespace trocar::bench {
namespace {

constexpr double radius_m = 5e-4;
constexpr double length_m = 0.03;
constexpr double depth_m = 0.018;  // a whole number of segments on every mesh
constexpr double glued_n_per_m = 1e9;
constexpr double growth = 1.6;  // of neighbouring elements, at a radius per element

// A node at 0 and elements that grow away from it, `smallest` there, symmetric.
std::vector<double> graded(double half_m, double smallest_m, double ratio) {
  std::vector<double> one{0.0};
  for (double step = smallest_m; one.back() < half_m; step *= ratio) one.push_back(one.back() + step);
  const double scale = half_m / one.back();
  std::vector<double> axis;
  for (std::size_t k = one.size(); k-- > 1;) axis.push_back(-scale * one[k]);
  for (const double x : one) axis.push_back(scale * x);
  return axis;
}

insertion::Pose pose(double depth) { return {0.0, depth - length_m, 0.5 * std::numbers::pi}; }

}  // namespace

SolidAnswer solid_answer(double radius_per_element) {
  const double h = radius_m / radius_per_element;
  // Halving elements halves what they grow by, too.
  const double ratio = std::pow(growth, 1.0 / radius_per_element);
  scene::Scene scene;
  scene.tissue.model = fem::Model::Solid;
  scene.tissue.integration = fem::Integration::BBar;
  fem::Grid grid;
  grid.element = fem::Type::Hex8;
  grid.axis_m[0] = graded(0.02, h, ratio);
  grid.axis_m[2] = graded(0.0055, h, ratio);
  const double along = 4.0 * h;
  const int rows = static_cast<int>(std::lround(0.02 / along));
  for (int j = 0; j <= rows; ++j) grid.axis_m[1].push_back(0.02 * j / rows);
  for (double step = 1.0; grid.axis_m[1].back() < 0.04 - 1e-9; step *= ratio)
    grid.axis_m[1].push_back(std::min(0.04, grid.axis_m[1].back() + step * along));
  scene.tissue.grid = grid;
  scene.tissue.zones = {{.material = {25.3e3, 0.48}}};
  scene.tissue.supports = {{fem::Side::YMax, {true, true, true}}};
  scene.needle = scene::Needle{.length_m = length_m, .outer_m = 2.0 * radius_m};
  scene.contact = contact::Law{.shaft_n_per_m = shaft_n_per_m, .tip_n_per_m = tip_n_per_m, .tip_zone_m = tip_zone_m};
  scene.contact->spacing_m = 1.5 * along;
  scene.corridor = scene::Corridor{{0.0, 0.0}, {0.0, 0.02}, 0.5 * h};
  const Compiled compiled(scene);

  SolidAnswer answer;
  answer.radius_per_element = radius_per_element;
  answer.unknowns = 3 * compiled.mesh().node.size();
  const auto ask = [&](double density_factor, double along_m, double across_m, double* tip_m) {
    contact::Law law = compiled.law();
    law.shaft_n_per_m *= density_factor;
    law.tip_n_per_m *= density_factor;
    model::Image image = compiled.image();
    image.law = &law;
    const auto needle = std::make_unique<insertion::Insertion>();
    needle->open(image);
    needle->step(pose(depth_m), 1e-3);
    insertion::Pose moved = pose(depth_m);
    moved.y_m += along_m;
    moved.x_m += across_m;
    const insertion::Result result = needle->step(moved, 1e-3);
    if (result.status != insertion::Status::Ok)
      throw std::runtime_error(std::string("a step in the solid ended with: ") + insertion::to_string(result.status));
    answer.contacts = result.contacts;
    if (tip_m != nullptr) {
      const contact::Vector2 tip{0.0, depth_m};
      contact::WorkingSet& set = needle->working_set();
      *tip_m = set.displacement_m(set.geometry().point(set.geometry().locate(tip, -1), tip))[1];
    }
    return result.base;
  };
  constexpr double small_m = 1e-4;
  constexpr double slip_motion_m = 2.5e-3;
  answer.axial_n_per_m = ask(glued_n_per_m, small_m, 0.0, nullptr).fy_n / small_m;
  answer.lateral_n_per_m = ask(glued_n_per_m, 0.0, small_m, nullptr).fx_n / small_m;
  answer.slip_force_n = ask(1.0, slip_motion_m, 0.0, &answer.tip_m).fy_n;
  return answer;
}

}  // namespace trocar::bench
