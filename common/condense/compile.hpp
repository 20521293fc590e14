// Condenses a scene into a model image: C = P^T A P for the candidates (A = K^-1 with the supports eliminated, P in candidates.hpp), and
// the visible map u_V = A_VC f. K is factored once; only the columns A P are computed, in blocks on all cores, and each block is reduced to
// the candidates' and the visible rows at once, so memory stays near that of the results.
#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

#include "common/condense/plan.hpp"
#include "common/image_file/bytes.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

// Called from one thread at a time. What it throws ends the work.
using Progress = std::function<void(std::string_view phase, double fraction)>;

struct Options {
  std::size_t most_memory_bytes = 16'000'000'000;
  WithVisible visible = WithVisible::Yes;
  Progress progress{};
};

struct Compiled {
  image_file::AlignedBytes image{};
  image_file::AlignedBytes visible{};  // empty without
  std::size_t factor_bytes{};
  double factor_s{}, columns_s{}, total_s{};
};

// Throws config::UserError that begins with the scene's file: unsupported or inverted meshes and whatever else common/fem refuses, more
// memory needed than allowed, a compliance that is not positive.
[[nodiscard]] Compiled compile(const scene::Scene& scene, const Plan& plan, const Options& options = {});

// Plan and compile in one.
[[nodiscard]] Compiled compile_to_memory(const scene::Scene& scene, const Options& options = {});

}  // namespace trocar::condense
