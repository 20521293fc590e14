#include "common/condense/compile.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "common/condense/float32_error.hpp"
#include "common/condense/naming_the_file.hpp"
#include "common/fem/statics.hpp"

namespace trocar::condense {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

constexpr Eigen::Index block_columns = 64;

double gigabytes(std::size_t bytes) { return static_cast<double>(bytes) * 1e-9; }

void refuse_memory(const Plan& plan, std::size_t factor_bytes, std::size_t most) {
  const std::size_t need = peak_memory_bytes(plan.cost, factor_bytes);
  if (need <= most) return;
  throw fem::Error(
      fmt::format("compiling needs about {:.3g} GB of memory and {:.3g} GB are allowed ({} unknowns, {} columns); narrow contact.corridor, "
                  "coarsen the mesh, or allow more with --memory",
                  gigabytes(need), gigabytes(most), plan.cost.unknowns, plan.cost.columns));
}

struct Condensed {
  Eigen::MatrixXd compliance{};
  std::vector<float> visible{};  // column after column
};

Condensed condense(const fem::Statics& statics, const Plan& plan, const Options& options) {
  const Eigen::SparseMatrix<double>& load = plan.candidates.load;
  const Eigen::Index n = load.cols();
  const Eigen::Index dimension = plan.mesh.dimension();
  const auto visible_rows = dimension * static_cast<Eigen::Index>(plan.visible.node.size());
  Condensed result;
  result.compliance.resize(n, n);
  result.visible.resize(options.visible == WithVisible::Yes ? static_cast<std::size_t>(visible_rows * n) : 0);
  const Eigen::SparseMatrix<double, Eigen::RowMajor> average = load.transpose();
  std::vector<bool> wanted(static_cast<std::size_t>(load.rows()), false);
  for (Eigen::Index column = 0; column < n; ++column)
    for (Eigen::SparseMatrix<double>::InnerIterator it(load, column); it; ++it) wanted[static_cast<std::size_t>(it.row())] = true;
  if (!result.visible.empty())
    for (const int node : plan.visible.node)
      for (Eigen::Index axis = 0; axis < dimension; ++axis) wanted[static_cast<std::size_t>(dimension * node + axis)] = true;
  Eigen::Index done = 0;
  statics.solve_columns(load, block_columns, wanted, [&](Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& u) {
    result.compliance.middleCols(first, u.cols()) = average * u;
    if (!result.visible.empty())
      for (Eigen::Index c = 0; c < u.cols(); ++c) {
        float* out = result.visible.data() + (first + c) * visible_rows;
        for (const int node : plan.visible.node)
          for (Eigen::Index axis = 0; axis < dimension; ++axis) *out++ = static_cast<float>(u(dimension * node + axis, c));
      }
    done += u.cols();
    if (options.progress) options.progress("solving columns", static_cast<double>(done) / static_cast<double>(n));
  });
  return result;
}

// C is symmetric but for rounding; the tick is promised to the bit.
void symmetrise(Eigen::MatrixXd& c) {
  constexpr Eigen::Index tile = 64;
  for (Eigen::Index column = 0; column < c.cols(); column += tile)
    for (Eigen::Index row = column; row < c.rows(); row += tile)
      for (Eigen::Index j = column; j < std::min(c.cols(), column + tile); ++j)
        for (Eigen::Index i = std::max(j, row); i < std::min(c.rows(), row + tile); ++i) c(i, j) = c(j, i) = 0.5 * (c(i, j) + c(j, i));
}

void check_positive(const Eigen::MatrixXd& c, const Candidates& candidates) {
  for (Eigen::Index i = 0; i < c.rows(); ++i) {
    const auto node = static_cast<std::size_t>(i / 2);
    const bool fixed = (candidates.flags[node] & (i % 2 == 0 ? model::fixed_x : model::fixed_y)) != 0;
    if (!c.col(i).allFinite() || (!fixed && !(c(i, i) > 0.0)))
      throw fem::Error(
          fmt::format("the compliance at ({}, {}) m is {}: the mesh is too badly shaped to be solved there; improve its elements",
                      candidates.node_m[node][0], candidates.node_m[node][1], c(i, i)));
  }
}

Compiled compile_checked(const scene::Scene& scene, const Plan& plan, const Options& options) {
  const Clock::time_point start = Clock::now();
  const auto say = [&](std::string_view phase, double fraction) {
    if (options.progress) options.progress(phase, fraction);
  };
  Compiled out;
  refuse_memory(plan, plan.cost.factor_bytes, options.most_memory_bytes);
  say("factoring", 0.0);
  Condensed condensed;
  {
    const fem::Statics statics(plan.mesh, scene.tissue);
    out.factor_bytes = statics.factor_info().bytes;
    out.factor_s = seconds_since(start);
    refuse_memory(plan, out.factor_bytes, options.most_memory_bytes);
    say("solving columns", 0.0);
    const Clock::time_point columns = Clock::now();
    condensed = condense(statics, plan, options);
    out.columns_s = seconds_since(columns);
  }
  say("writing", 0.0);
  symmetrise(condensed.compliance);
  check_positive(condensed.compliance, plan.candidates);

  model::Image image = plan.image(scene);
  image.float32_error = float32_error(condensed.compliance, reference_line(plan.candidates, scene, plan.law.spacing_m));
  const auto entries = static_cast<std::size_t>(condensed.compliance.size());
  std::vector<float> rounded;
  if (plan.single_precision) {
    rounded.assign(condensed.compliance.data(), condensed.compliance.data() + entries);
    image.tissue.compliance32 = rounded;
  } else {
    image.tissue.compliance64 = {condensed.compliance.data(), entries};
  }
  out.image = image_file::AlignedBytes(model::image_size(image));
  model::write(image, out.image.span());
  // What the rig would refuse is not written.
  if (const model::ImageStatus status = model::open(out.image.span(), image); status != model::ImageStatus::Ok)
    throw fem::Error(fmt::format("the compiled image {}", model::to_string(status)));

  if (options.visible == WithVisible::Yes) {
    out.visible = image_file::AlignedBytes(plan.cost.visible_bytes);
    image_file::write_visible({.image_checksum = image.checksum,
                               .dimension = static_cast<std::uint32_t>(plan.mesh.dimension()),
                               .node_m = plan.visible.node_m,
                               .face = plan.visible.face,
                               .columns = plan.cost.columns,
                               .compliance = condensed.visible},
                              out.visible.span());
  }
  say("writing", 1.0);
  out.total_s = seconds_since(start);
  return out;
}

}  // namespace

Compiled compile(const scene::Scene& scene, const Plan& plan, const Options& options) {
  return naming_the_file(scene, [&] { return compile_checked(scene, plan, options); });
}

Compiled compile_to_memory(const scene::Scene& scene, const Options& options) {
  return compile(scene, plan(scene, options.visible), options);
}

}  // namespace trocar::condense
