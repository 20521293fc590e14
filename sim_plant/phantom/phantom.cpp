#include "sim_plant/phantom/phantom.hpp"

#include <string>

#include "common/condense/compile.hpp"
#include "common/config/user_error.hpp"

namespace trocar::sim_plant {

Phantom::Phantom(const std::optional<scene::Scene>& scene) {
  if (!scene) return;
  scene::require_insertion(*scene);
  condense::Options options;
  options.visible = condense::WithVisible::No;
  bytes_ = condense::compile_to_memory(*scene, options).image;
  const model::ImageStatus status = model::open(bytes_.span(), image_);
  if (status != model::ImageStatus::Ok) throw config::UserError(scene->file.string() + ": " + to_string(status));
  insertion_ = std::make_unique<insertion::Insertion>();
  insertion_->open(image_);
}

Phantom::Vector3 Phantom::advance(const Vector3& base_pose, double dt_s) noexcept {
  if (empty()) return wrench_;
  using insertion::Status;
  const insertion::Result result = insertion_->step({base_pose[0], base_pose[1], base_pose[2]}, dt_s);
  ++counters_.steps;
  counters_.refused += result.status == Status::NotFinite ? 1u : 0u;
  counters_.incomplete += result.status == Status::CapacityReached || result.status == Status::LeftCandidates ? 1u : 0u;
  counters_.unconverged += result.status >= Status::TipLost && result.status <= Status::NotConverged ? 1u : 0u;
  counters_.pivots += static_cast<std::uint64_t>(result.pivots);
  counters_.rows_factored += static_cast<std::uint64_t>(result.rows_factored);
  residual_n_ = result.residual_n;
  wrench_ = {result.base.fx_n, result.base.fy_n, result.base.tau_nm};
  return wrench_;
}

}  // namespace trocar::sim_plant
