#include "tests/benchmarks/contact/whole_step.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "common/condense/compile.hpp"
#include "tests/benchmarks/contact/timing.hpp"
#include "tests/benchmarks/partner/sheet.hpp"

namespace trocar::bench {
namespace {

constexpr double length_m = 0.1;
constexpr double entry_y_m = -0.05;

scene::Scene scene_of(int nodes_per_side, std::size_t contacts) {
  scene::Scene scene;
  scene.tissue = partner::sheet_tissue(nodes_per_side);
  scene.needle = scene::Needle{.length_m = length_m};
  contact::Law law;
  law.shaft_n_per_m = 34.0;
  law.tip_n_per_m = 68.0;
  law.tip_zone_m = 0.0025;
  law.spacing_m = 0.07 / static_cast<double>(contacts);
  scene.contact = law;
  scene.corridor = scene::Corridor{{0.0, entry_y_m}, {0.0, 0.04}, 0.0025};
  return scene;
}

insertion::Pose pose(double depth_m, double turn_rad) {
  const double theta = std::numbers::pi / 2 + turn_rad;
  return {(depth_m - length_m) * std::cos(theta), entry_y_m + (depth_m - length_m) * std::sin(theta), theta};
}

}  // namespace

WholeStep::WholeStep(int nodes_per_side, std::size_t contacts, Motion motion, bool reuse_factor) : motion_(motion) {
  bytes_ = condense::compile_to_memory(scene_of(nodes_per_side, contacts), {.visible = condense::WithVisible::No}).image;
  if (const model::ImageStatus status = model::open(bytes_.span(), image_); status != model::ImageStatus::Ok)
    throw std::runtime_error(std::string("the compiled scene is refused: ") + model::to_string(status));
  insertion_->open(image_);
  insertion_->skip(reuse_factor);
  depth_m_ = -0.01;
  if (motion == Motion::Outside) return;
  for (; insertion_->contacts() < contacts; depth_m_ += 2e-4) {
    if (depth_m_ > 0.09) throw std::runtime_error("the needle reaches the end of the tissue before it has its contacts");
    settle(pose(depth_m_, 0.0));
  }
  depth_m_ -= 2e-4;
}

void WholeStep::settle(const insertion::Pose& at) {
  if (const insertion::Status status = insertion_->step(at, 1e-3).status; status != insertion::Status::Ok)
    throw std::runtime_error(std::string("a step ended with: ") + insertion::to_string(status));
}

double WholeStep::tick() {
  const double phase = 2.0 * std::numbers::pi * static_cast<double>(++tick_) / 1000.0;
  const double turn_rad = motion_ == Motion::Turn ? 0.005 * std::sin(phase) : 0.0;
  const double back_m = motion_ == Motion::ToAndFro  ? 5e-4 * (1.0 - std::cos(phase))
                        : motion_ == Motion::Outside ? 1e-3 * std::sin(phase)
                                                     : 0.0;
  const insertion::Pose at = pose(depth_m_ - back_m, turn_rad);
  return timed([&] { settle(at); });
}

double WholeStep::slipping() const {
  double count = 0.0;
  for (std::size_t i = 0; i < insertion_->contacts(); ++i) count += insertion_->contact(i).state == contact::State::Stuck ? 0.0 : 1.0;
  return insertion_->contacts() == 0 ? 0.0 : count / static_cast<double>(insertion_->contacts());
}

}  // namespace trocar::bench
