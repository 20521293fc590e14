#include "tests/benchmarks/partner/sheet.hpp"

#include <cmath>
#include <stdexcept>

namespace trocar::partner {
namespace {

constexpr double side_m = 0.1;

}  // namespace

fem::Tissue sheet_tissue(int nodes_per_side) {
  fem::Tissue tissue;
  tissue.model = fem::Model::PlaneStress;
  tissue.thickness_m = 0.011;
  tissue.grid =
      fem::uniform_grid(fem::Type::Tri3, {-side_m / 2, -side_m / 2, 0.0}, {side_m, side_m, 0.0}, {nodes_per_side, nodes_per_side, 1});
  tissue.zones.push_back({{25300.0, 0.48}, {}, {}});
  tissue.supports.push_back({fem::Side::YMax, {true, true, false}});
  return tissue;
}

Sheet make_sheet(int nodes_per_side) {
  const fem::Tissue tissue = sheet_tissue(nodes_per_side);
  Sheet sheet;
  sheet.mesh = fem::make_mesh(tissue);
  sheet.statics = std::make_unique<fem::Statics>(sheet.mesh, tissue);

  int rows = 0;
  for (Eigen::Index k = 0; k < sheet.statics->degrees_of_freedom(); ++k) sheet.row.push_back(sheet.statics->supported(k) ? -1 : rows++);
  const Eigen::SparseMatrix<double>& all = sheet.statics->stiffness_n_per_m();
  std::vector<Eigen::Triplet<double>> kept;
  kept.reserve(static_cast<std::size_t>(all.nonZeros()));
  for (Eigen::Index c = 0; c < all.cols(); ++c)
    for (Eigen::SparseMatrix<double>::InnerIterator it(all, c); it; ++it) {
      const int row = sheet.row[static_cast<std::size_t>(it.row())], column = sheet.row[static_cast<std::size_t>(c)];
      if (row >= 0 && column >= 0) kept.emplace_back(row, column, it.value());
    }
  sheet.stiffness.resize(rows, rows);
  sheet.stiffness.setFromTriplets(kept.begin(), kept.end());
  return sheet;
}

std::vector<int> axis_nodes(const Sheet& sheet, std::size_t contacts, double depth_m) {
  const auto per_side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(sheet.mesh.node.size()))));
  const double edge_m = side_m / (per_side - 1), step_m = depth_m / static_cast<double>(contacts);
  if (step_m < edge_m * 0.999) throw std::runtime_error("sheet: more contacts than nodes along the needle");
  std::vector<int> nodes;
  for (std::size_t i = 0; i < contacts; ++i)
    nodes.push_back(static_cast<int>(std::lround(step_m * static_cast<double>(i) / edge_m)) * per_side + per_side / 2);
  return nodes;
}

Eigen::MatrixXd compliance(const Sheet& sheet, std::span<const int> nodes) {
  const auto m = static_cast<Eigen::Index>(2 * nodes.size());
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(sheet.statics->degrees_of_freedom(), m);
  for (Eigen::Index k = 0; k < m; ++k) loads(2 * nodes[static_cast<std::size_t>(k / 2)] + k % 2, k) = 1.0;
  const Eigen::MatrixXd u = sheet.statics->solve(loads);
  Eigen::MatrixXd g(m, m);
  for (Eigen::Index k = 0; k < m; ++k) g.row(k) = u.row(2 * nodes[static_cast<std::size_t>(k / 2)] + k % 2);
  return 0.5 * (g + g.transpose());
}

std::vector<ContactNode> contact_nodes(const Sheet& sheet, std::span<const int> nodes) {
  std::vector<ContactNode> contact;
  for (const int node : nodes)
    contact.push_back({sheet.row[static_cast<std::size_t>(2 * node)], sheet.row[static_cast<std::size_t>(2 * node + 1)]});
  return contact;
}

}  // namespace trocar::partner
