// `trocar solve`: scene and loads in, displacements out.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

namespace trocar::host {

struct SolveOptions {
  std::filesystem::path scene{};
  std::filesystem::path loads{};
  std::filesystem::path out{};                                                  // CSV node,x_m,y_m[,z_m],ux_m,uy_m[,uz_m]
  std::filesystem::path vtu{};                                                  // fields for ParaView; empty for none
  std::function<void(const std::string&)> progress{[](const std::string&) {}};  // one line for each long step of a large problem
};

struct SolveSummary {
  int dimension{};
  std::size_t nodes{}, elements{}, unknowns{}, loaded_nodes{};
  bool green_lagrange{};
  int iterations{1};                             // of Newton; 1 for small strain
  double residual_n{};                           // norm over free degrees of freedom
  std::array<double, 3> load_n{}, reaction_n{};  // sums of the loads, and of what the supports exert
  double largest_m{};                            // displacement, at this node
  std::size_t largest_node{};
  std::array<double, 3> largest_at_m{};
  double energy_j{};  // f.u / 2 for small strain, 0 otherwise
  double seconds{};
};

// Throws config::UserError: scene, loads or model that cannot be used, no equilibrium found, results that cannot be written, `stop` set.
// Then no result is there.
[[nodiscard]] SolveSummary run_solve(const SolveOptions& options, const std::atomic<bool>& stop);

[[nodiscard]] std::string to_json(const SolveSummary& summary);
[[nodiscard]] std::string to_text(const SolveSummary& summary);

}  // namespace trocar::host
