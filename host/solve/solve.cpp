#include "host/solve/solve.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <ostream>

#include "common/config/new_file.hpp"
#include "common/config/user_error.hpp"
#include "common/fem/nonlinear.hpp"
#include "common/fem/statics.hpp"
#include "common/fem/stress.hpp"
#include "common/scene/scene.hpp"
#include "host/solve/loads.hpp"
#include "host/solve/vtu.hpp"

namespace trocar::host {
namespace {

constexpr std::size_t large = 30000;  // unknowns; below, everything takes less than a second

struct Equilibrium {
  Eigen::VectorXd displacement_m{};
  Eigen::VectorXd internal_n{};  // K u
  Eigen::VectorXd residual_n{};  // on free degrees of freedom, zero elsewhere
  int iterations{1};
};

Equilibrium solve_linear(const fem::Mesh& mesh, const fem::Tissue& tissue, const Eigen::VectorXd& load) {
  const fem::Statics statics(mesh, tissue);
  Equilibrium found;
  found.displacement_m = statics.solve(load);
  found.internal_n = statics.stiffness_n_per_m() * found.displacement_m;
  found.residual_n = found.internal_n - load;
  for (Eigen::Index i = 0; i < load.size(); ++i)
    if (statics.supported(i)) found.residual_n[i] = 0.0;
  return found;
}

// Forces of the deformed elements on their nodes, summed without the solver.
Eigen::VectorXd internal_forces(const fem::Mesh& mesh, const fem::Tissue& tissue, const Eigen::VectorXd& u) {
  const auto elasticity = fem::elasticities(mesh, tissue);
  const auto zone = fem::zones_of(mesh, tissue.zones);
  const int d = mesh.dimension();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(u.size());
  element::Values own;
  element::Values force;
  element::Stiffness tangent;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    const auto row = [&](int k) { return mesh.element[e][static_cast<std::size_t>(k / d)] * d + k % d; };
    own.setZero();
    for (int k = 0; k < mesh.nodes_per_element() * d; ++k) own[k] = u[row(k)];
    // Inverted cannot be: the solver has refused such a mesh.
    (void)element::response(mesh.type, tissue.integration, mesh.corners(e), elasticity[static_cast<std::size_t>(zone[e])],
                            tissue.thickness_m, own, force, tangent);
    for (int k = 0; k < mesh.nodes_per_element() * d; ++k) sum[row(k)] += force[k];
  }
  return sum;
}

Equilibrium solve_nonlinear(const fem::Mesh& mesh, const fem::Tissue& tissue, const Eigen::VectorXd& load) {
  const fem::NonlinearResult result = fem::solve_green_lagrange(mesh, tissue, load);
  if (!result.converged)
    throw fem::Error(fmt::format("no equilibrium beyond {:.3g} of the loads: {}; lower the loads, or take strain = \"linear\"",
                                 result.load_fraction, result.failure));
  Equilibrium found;
  found.displacement_m = result.displacement_m;
  found.internal_n = internal_forces(mesh, tissue, found.displacement_m);
  found.residual_n = found.internal_n - load;
  const std::vector<bool> supported = fem::supported_degrees_of_freedom(mesh, tissue.supports);
  for (std::size_t i = 0; i < supported.size(); ++i)
    if (supported[i]) found.residual_n[static_cast<Eigen::Index>(i)] = 0.0;
  found.iterations = result.iterations;
  return found;
}

void write_table(std::ostream& stream, const fem::Mesh& mesh, const Eigen::VectorXd& u) {
  const bool solid = mesh.dimension() == 3;
  stream << (solid ? "node,x_m,y_m,z_m,ux_m,uy_m,uz_m\n" : "node,x_m,y_m,ux_m,uy_m\n");
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const fem::Point& x = mesh.node[n];
    const auto i = static_cast<Eigen::Index>(n) * mesh.dimension();
    stream << (solid ? fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", n, x[0], x[1], x[2], u[i], u[i + 1], u[i + 2])
                     : fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g}\n", n, x[0], x[1], u[i], u[i + 1]));
  }
}

std::vector<double> as_vectors(const fem::Mesh& mesh, const Eigen::VectorXd& value) {
  std::vector<double> out;
  for (Eigen::Index n = 0; n < static_cast<Eigen::Index>(mesh.node.size()); ++n)
    for (int a = 0; a < 3; ++a) out.push_back(a < mesh.dimension() ? value[n * mesh.dimension() + a] : 0.0);
  return out;
}

void write_fields(std::ostream& stream, const fem::Mesh& mesh, const fem::Tissue& tissue, const Eigen::VectorXd& u,
                  const Eigen::VectorXd& load) {
  Field stress{tissue.strain == fem::Strain::Linear ? "stress_pa" : "second_piola_kirchhoff_stress_pa", 6, {}};
  Field mises{"von_mises_pa", 1, {}};
  for (const fem::Stress& s : fem::centre_stresses(mesh, tissue, u)) {
    stress.value.insert(stress.value.end(), s.begin(), s.end());
    mises.value.push_back(fem::von_mises_pa(s));
  }
  Field young{"young_pa", 1, {}};
  Field poisson{"poisson", 1, {}};
  for (const int zone : fem::zones_of(mesh, tissue.zones)) {
    young.value.push_back(tissue.zones[static_cast<std::size_t>(zone)].material.young_pa);
    poisson.value.push_back(tissue.zones[static_cast<std::size_t>(zone)].material.poisson);
  }
  write_vtu(stream, mesh, {{"displacement_m", 3, as_vectors(mesh, u)}, {"load_n", 3, as_vectors(mesh, load)}},
            {stress, mises, young, poisson});
}

SolveSummary summarise(const fem::Mesh& mesh, const Equilibrium& found, const Eigen::VectorXd& load) {
  SolveSummary s;
  s.dimension = mesh.dimension();
  s.nodes = mesh.node.size();
  s.elements = mesh.element.size();
  s.unknowns = static_cast<std::size_t>(load.size());
  s.iterations = found.iterations;
  s.residual_n = found.residual_n.norm();
  for (std::size_t n = 0; n < s.nodes; ++n) {
    double squared = 0.0;
    for (int a = 0; a < s.dimension; ++a) {
      const Eigen::Index i = static_cast<Eigen::Index>(n) * s.dimension + a;
      s.load_n[static_cast<std::size_t>(a)] += load[i];
      s.reaction_n[static_cast<std::size_t>(a)] += found.internal_n[i] - found.residual_n[i] - load[i];
      squared += found.displacement_m[i] * found.displacement_m[i];
    }
    if (std::sqrt(squared) > s.largest_m || n == 0) {
      s.largest_m = std::sqrt(squared);
      s.largest_node = n;
      s.largest_at_m = mesh.node[n];
    }
  }
  return s;
}

std::string list_of(const std::array<double, 3>& x, int dimension) {
  return dimension == 2 ? fmt::format("[{}, {}]", x[0], x[1]) : fmt::format("[{}, {}, {}]", x[0], x[1], x[2]);
}

}  // namespace

SolveSummary run_solve(const SolveOptions& options, const std::atomic<bool>& stop) {
  const auto begin = std::chrono::steady_clock::now();
  const auto go_on = [&] {
    if (stop.load()) throw config::UserError("stopped; nothing was written");
  };
  const scene::Scene scene = scene::read_scene(options.scene);
  config::NewFile table(options.out);
  std::optional<config::NewFile> fields;
  if (!options.vtu.empty()) fields.emplace(options.vtu);
  try {
    const fem::Mesh mesh = fem::make_mesh(scene.tissue);
    const Loads loads = read_loads(options.loads, mesh);
    go_on();
    if (static_cast<std::size_t>(loads.force_n.size()) > large)
      options.progress(fmt::format("{} nodes, {} unknowns: assembling, factoring, solving …", mesh.node.size(), loads.force_n.size()));
    const Equilibrium found = scene.tissue.strain == fem::Strain::GreenLagrange ? solve_nonlinear(mesh, scene.tissue, loads.force_n)
                                                                                : solve_linear(mesh, scene.tissue, loads.force_n);
    go_on();
    if (static_cast<std::size_t>(loads.force_n.size()) > large) options.progress("writing the results …");
    write_table(table.stream(), mesh, found.displacement_m);
    if (fields) write_fields(fields->stream(), mesh, scene.tissue, found.displacement_m, loads.force_n);
    go_on();
    SolveSummary summary = summarise(mesh, found, loads.force_n);
    summary.loaded_nodes = loads.nodes;
    summary.green_lagrange = scene.tissue.strain == fem::Strain::GreenLagrange;
    if (!summary.green_lagrange) summary.energy_j = 0.5 * found.displacement_m.dot(loads.force_n);
    if (fields) fields->keep();
    table.keep();
    summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return summary;
  } catch (const fem::Error& error) {
    throw config::UserError(fmt::format("{}: {}", options.scene.string(), error.what()));
  }
}

std::string to_json(const SolveSummary& s) {
  return fmt::format(
      "{{\"nodes\": {}, \"elements\": {}, \"degrees_of_freedom\": {}, \"loaded_nodes\": {}, \"strain\": \"{}\", \"iterations\": {}, "
      "\"residual_n\": {}, \"load_n\": {}, \"reaction_n\": {}, \"largest_displacement\": {{\"node\": {}, \"at_m\": {}, \"length_m\": {}}}, "
      "\"energy_j\": {}, \"seconds\": {:.3f}}}",
      s.nodes, s.elements, s.unknowns, s.loaded_nodes, s.green_lagrange ? "green_lagrange" : "linear", s.iterations, s.residual_n,
      list_of(s.load_n, s.dimension), list_of(s.reaction_n, s.dimension), s.largest_node, list_of(s.largest_at_m, s.dimension), s.largest_m,
      s.green_lagrange ? "null" : fmt::format("{}", s.energy_j), s.seconds);
}

std::string to_text(const SolveSummary& s) {
  return fmt::format("{} nodes, {} elements, {} loaded nodes; largest displacement {:.6g} mm at node {}, {} m", s.nodes, s.elements,
                     s.loaded_nodes, 1e3 * s.largest_m, s.largest_node, list_of(s.largest_at_m, s.dimension));
}

}  // namespace trocar::host
