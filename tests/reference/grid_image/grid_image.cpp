#include "tests/reference/grid_image/grid_image.hpp"

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/model/verify.hpp"

namespace trocar::reference {
namespace {

fem::Grid grid_of(const Block& block) {
  return fem::uniform_grid(block.element, {-0.5 * block.width_m, 0.0, 0.0}, {block.width_m, block.depth_m, 0.0},
                           {block.nodes_x, block.nodes_y, 1});
}

double edge_of(const Block& block) { return block.width_m / (block.nodes_x - 1); }

fem::Mesh mesh_of(const Block& block) {
  fem::Mesh mesh = fem::structured_grid(grid_of(block));
  // Weyl's sequence: even, without a generator.
  double x = 0.0;
  double y = 0.0;
  for (int j = 0; j < block.nodes_y; ++j) {
    for (int i = 0; i < block.nodes_x; ++i) {
      x = std::fmod(x + 0.6180339887498949, 1.0);
      y = std::fmod(y + 0.4142135623730951, 1.0);
      if (i == 0 || j == 0 || i + 1 == block.nodes_x || j + 1 == block.nodes_y) continue;
      fem::Point& node = mesh.node[static_cast<std::size_t>(j * block.nodes_x + i)];
      node[0] += block.distortion * (2 * x - 1) * edge_of(block);
      node[1] += block.distortion * (2 * y - 1) * block.depth_m / (block.nodes_y - 1);
    }
  }
  return mesh;
}

fem::Tissue tissue_of(const Block& block) {
  fem::Tissue tissue;
  tissue.model = block.model;
  tissue.integration = block.integration;
  tissue.thickness_m = 0.011;
  tissue.grid = grid_of(block);
  tissue.zones = block.zones;
  tissue.supports = {{fem::Side::YMax, {true, true, false}}};
  return tissue;
}

}  // namespace

GridImage::GridImage(const Block& block) : GridImage(mesh_of(block), tissue_of(block), edge_of(block)) {}

GridImage::GridImage(fem::Mesh mesh, const fem::Tissue& tissue, double edge_length_m)
    : tissue_(tissue), mesh_(std::move(mesh)), edge_length_m_(edge_length_m), statics_(std::make_unique<fem::Statics>(mesh_, tissue_)) {
  for (const fem::Point& p : mesh_.node) node_m_.push_back({p[0], p[1]});
  for (const fem::Zone& zone : tissue_.zones) material_.push_back(zone.material);
  model::Tissue& t = image_.tissue;
  t.model = tissue_.model;
  t.integration = tissue_.integration;
  t.thickness_m = tissue_.thickness_m;
  t.edge_length_m = edge_length_m;
  add_neighbours();
  add_rings();
  add_buckets();
  add_compliance();
  t.node_m = node_m_;
  t.node_flags = flags_;
  t.cell = cell_;
  t.ring_begin = ring_begin_;
  t.ring_cell = ring_cell_;
  t.material = material_;
  t.buckets.begin = bucket_begin_;
  t.buckets.cell = bucket_cell_;
  t.compliance64 = compliance_;
  law.shaft_n_per_m = 34.0;
  law.tip_n_per_m = 68.0;
  law.tip_zone_m = 0.0025;
  law.spacing_m = edge_length_m;
  image_.law = &law;
  image_.needle = {0.1, 0.0};
  if (const model::ImageStatus status = model::verify(image_); status != model::ImageStatus::Ok)
    throw std::logic_error(std::string("grid image: ") + model::to_string(status));
}

void GridImage::add_neighbours() {
  const auto corners = static_cast<std::size_t>(mesh_.nodes_per_element());
  const std::vector<int> zone = fem::zones_of(mesh_, tissue_.zones);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> cell_of_edge;
  for (std::size_t e = 0; e < mesh_.element.size(); ++e) {
    model::Cell cell;
    cell.count = static_cast<std::uint16_t>(corners);
    cell.material = static_cast<std::uint16_t>(zone[e]);
    for (std::size_t k = 0; k < corners; ++k) cell.node[k] = static_cast<std::uint32_t>(mesh_.element[e][k]);
    for (std::size_t k = 0; k < corners; ++k) cell_of_edge[{cell.node[k], cell.node[(k + 1) % corners]}] = static_cast<std::int32_t>(e);
    cell_.push_back(cell);
  }
  for (model::Cell& cell : cell_) {
    cell.neighbour.fill(model::surface);
    for (std::size_t k = 0; k < corners; ++k) {
      const auto other = cell_of_edge.find({cell.node[(k + 1) % corners], cell.node[k]});
      if (other != cell_of_edge.end()) cell.neighbour[k] = other->second;
    }
  }
}

void GridImage::add_rings() {
  std::vector<std::vector<std::uint32_t>> ring(node_m_.size());
  for (std::size_t e = 0; e < cell_.size(); ++e)
    for (std::size_t k = 0; k < cell_[e].count; ++k) ring[cell_[e].node[k]].push_back(static_cast<std::uint32_t>(e));
  ring_begin_.push_back(0);
  for (const auto& cells : ring) {
    if (cells.size() <= capacity::ring_cells)
      image_.need.ring_cells = std::max(image_.need.ring_cells, static_cast<std::uint32_t>(cells.size()));
    ring_cell_.insert(ring_cell_.end(), cells.begin(), cells.end());
    ring_begin_.push_back(static_cast<std::uint32_t>(ring_cell_.size()));
  }
  for (std::size_t n = 0; n < node_m_.size(); ++n) {
    std::uint8_t flags = ring[n].size() <= capacity::ring_cells ? model::whole_ring : std::uint8_t{0};
    if (statics_->supported(static_cast<Eigen::Index>(2 * n))) flags |= model::fixed_x;
    if (statics_->supported(static_cast<Eigen::Index>(2 * n + 1))) flags |= model::fixed_y;
    flags_.push_back(flags);
  }
}

void GridImage::add_buckets() {
  const fem::Box box = fem::bounding_box(mesh_);
  model::Buckets& buckets = image_.tissue.buckets;
  buckets.origin_m = {box.min_m[0], box.min_m[1]};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double extent = box.max_m[axis] - box.min_m[axis];
    buckets.count[axis] = static_cast<std::uint32_t>(std::max(1.0, std::round(extent / edge_length_m_)));
    buckets.size_m[axis] = extent / buckets.count[axis];
  }
  std::vector<std::vector<std::uint32_t>> list(std::size_t{buckets.count[0]} * buckets.count[1]);
  for (std::size_t e = 0; e < cell_.size(); ++e) {
    std::array<std::uint32_t, 2> low{};
    std::array<std::uint32_t, 2> high{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double least = node_m_[cell_[e].node[0]][axis];
      double most = least;
      for (std::size_t k = 1; k < cell_[e].count; ++k) {
        least = std::min(least, node_m_[cell_[e].node[k]][axis]);
        most = std::max(most, node_m_[cell_[e].node[k]][axis]);
      }
      low[axis] = model::bucket_index(buckets, axis, least);
      high[axis] = model::bucket_index(buckets, axis, most);
    }
    for (std::uint32_t j = low[1]; j <= high[1]; ++j)
      for (std::uint32_t i = low[0]; i <= high[0]; ++i) list[j * buckets.count[0] + i].push_back(static_cast<std::uint32_t>(e));
  }
  bucket_begin_.push_back(0);
  for (const auto& cells : list) {
    image_.need.cells_per_bucket = std::max(image_.need.cells_per_bucket, static_cast<std::uint32_t>(cells.size()));
    bucket_cell_.insert(bucket_cell_.end(), cells.begin(), cells.end());
    bucket_begin_.push_back(static_cast<std::uint32_t>(bucket_cell_.size()));
  }
}

void GridImage::add_compliance() {
  const auto n = static_cast<Eigen::Index>(2 * node_m_.size());
  Eigen::SparseMatrix<double> unit(n, n);
  unit.setIdentity();
  compliance_.resize(static_cast<std::size_t>(n * n));
  Eigen::Map<Eigen::MatrixXd> all(compliance_.data(), n, n);
  statics_->solve_columns(unit, 256,
                          [&](Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& u) { all.middleCols(first, u.cols()) = u; });
  all = (0.5 * (all + all.transpose())).eval();
}

std::unique_ptr<GridImage> GridImage::with_moved(const std::vector<std::pair<std::uint32_t, model::Vector2>>& moves) const {
  fem::Mesh mesh = mesh_;
  for (const auto& [node, x_m] : moves) mesh.node[node] = {x_m[0], x_m[1], 0.0};
  return std::make_unique<GridImage>(std::move(mesh), tissue_, edge_length_m_);
}

}  // namespace trocar::reference
