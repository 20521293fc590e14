// The needle in the simulated tissue, quasi-static: base pose in, base wrench out. The scene is condensed at construction
// (common/condense) and stepped by common/insertion, as in a controller with a virtual needle; which finite elements stand behind the
// wrench (a finer mesh, three dimensions, layers) is the scene's choice and costs a step nothing. Without a scene there is nothing in front
// of the machine, and no wrench.
//
// Frames and signs: rig frame; theta is the direction base -> tip; the wrench is what the base applies to the needle, which is
// the sum of the contact forces on the tissue; the moment is right-handed about the base.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "common/image_file/bytes.hpp"
#include "common/insertion/insertion.hpp"
#include "common/scene/scene.hpp"

namespace trocar::sim_plant {

class Phantom {
 public:
  using Vector3 = std::array<double, 3>;

  // Allocates. Throws config::UserError for a scene that cannot be computed or has no needle that can be inserted.
  explicit Phantom(const std::optional<scene::Scene>& scene);

  // base_pose: x_m, y_m, theta_rad. Returns N, N, N m. dt_s > 0 since the last call serves the speed alone. A pose or time
  // step that is not finite is refused: counted, and the last wrench stays.
  Vector3 advance(const Vector3& base_pose, double dt_s) noexcept;

  [[nodiscard]] const Vector3& base_wrench() const noexcept { return wrench_; }
  [[nodiscard]] bool empty() const noexcept { return insertion_ == nullptr; }                   // no scene
  [[nodiscard]] const insertion::Insertion& insertion() const noexcept { return *insertion_; }  // with a scene only
  [[nodiscard]] const model::Tissue& tissue() const noexcept { return image_.tissue; }          // likewise
  [[nodiscard]] std::size_t contacts() const noexcept { return empty() ? 0 : insertion_->contacts(); }

  struct Counters {  // since construction
    std::uint64_t steps{};
    std::uint64_t unconverged{};  // residual above its tolerance, tip searches out of iterations, a needle that bends without equilibrium
    std::uint64_t refused{};      // input not finite
    std::uint64_t incomplete{};   // steps in which a contact was missing: capacity, or the end of the candidates
    std::uint64_t pivots{};
    std::uint64_t rows_factored{};
  };
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] double residual_n() const noexcept { return residual_n_; }  // of the last step

 private:
  image_file::AlignedBytes bytes_;
  model::Image image_{};
  std::unique_ptr<insertion::Insertion> insertion_;
  Vector3 wrench_{};
  double residual_n_{};
  Counters counters_{};
};

}  // namespace trocar::sim_plant
