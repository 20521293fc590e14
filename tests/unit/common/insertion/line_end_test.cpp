// Where a stuck line ends is a singularity that neither nodes nor segments follow. What the working set does about it: the stiffness grows
// with the depth evenly, wherever the tip stands between nodes or segments, and is nearly that of much finer elements.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "common/condense/compile.hpp"
#include "common/insertion/insertion.hpp"

namespace trocar::insertion {
namespace {

using contact::Method;

constexpr double side_m = 0.1, needle_m = 0.06;

struct Case {
  const char* name;
  fem::Type type;
  Method method;
  double lean_rad;  // from +y towards +x
  fem::Model model{fem::Model::PlaneStress};
  double poisson{0.48};
  double distortion{};  // of the elements' edge, of inner nodes
};

model::Image image_of(const Case& what, int nodes, contact::Law& law, image_file::AlignedBytes& bytes) {
  scene::Scene scene;
  scene.tissue.model = what.model;
  scene.tissue.thickness_m = 0.011;
  scene.tissue.grid = fem::uniform_grid(what.type, {-0.5 * side_m, 0.0, 0.0}, {side_m, side_m, 0.0}, {nodes, nodes, 1});
  scene.tissue.zones = {{.material = {25.3e3, what.poisson}}};
  scene.tissue.supports = {{fem::Side::YMax, {true, true, false}}};
  scene.needle = scene::Needle{.length_m = needle_m};
  scene.contact = contact::Law{.shaft_n_per_m = 1e9, .tip_n_per_m = 1e9};  // never slips
  scene.corridor = scene::Corridor{{0.0, 0.0}, {0.05 * std::tan(what.lean_rad), 0.05}, 0.02};
  fem::Mesh mesh = fem::make_mesh(scene.tissue);
  const double edge_m = side_m / (nodes - 1);
  for (fem::Point& x : mesh.node) {
    if (std::abs(x[0]) > 0.5 * (side_m - edge_m) || std::abs(x[1] - 0.5 * side_m) > 0.5 * (side_m - edge_m)) continue;
    const fem::Point at = x;
    x[0] += what.distortion * edge_m * std::sin(900.0 * at[0] + 2600.0 * at[1]);
    x[1] += what.distortion * edge_m * std::sin(2300.0 * at[0] - 1100.0 * at[1]);
  }
  bytes = condense::compile(scene, condense::plan(scene, mesh, condense::WithVisible::No), {.visible = condense::WithVisible::No}).image;
  model::Image image;
  EXPECT_EQ(model::open(bytes.span(), image), model::ImageStatus::Ok);
  law = *image.law;
  law.method = what.method;
  image.law = &law;
  return image;
}

// Of the base, along the shaft and across it, the needle standing in undeformed tissue.
std::array<double, 2> stiffness_n_per_m(const model::Image& image, double lean_rad, double depth_m) {
  constexpr double small_m = 1e-4;
  const double tx = std::sin(lean_rad), ty = std::cos(lean_rad);
  std::array<double, 2> stiffness{};
  for (const bool along : {true, false}) {
    const auto needle = std::make_unique<Insertion>();
    needle->open(image);
    Pose base{0.0013 + (depth_m - needle_m) * tx, (depth_m - needle_m) * ty, 0.5 * std::numbers::pi - lean_rad};
    EXPECT_EQ(needle->step(base, 1e-3).status, Status::Ok);
    base.x_m += small_m * (along ? tx : -ty);
    base.y_m += small_m * (along ? ty : tx);
    const Wrench force = needle->step(base, 1e-3).base;
    stiffness[along ? 0 : 1] = (along ? tx * force.fx_n + ty * force.fy_n : tx * force.fy_n - ty * force.fx_n) / small_m;
  }
  return stiffness;
}

class LineEndBy : public ::testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(Paths, LineEndBy,
                         ::testing::Values(Case{"adapt_quads", fem::Type::Quad4, Method::Adapt, 0.0},
                                           Case{"adapt_quads_oblique", fem::Type::Quad4, Method::Adapt, 0.3},
                                           Case{"adapt_triangles", fem::Type::Tri3, Method::Adapt, 0.0},
                                           Case{"embedded_quads", fem::Type::Quad4, Method::Embedded, 0.0},
                                           Case{"embedded_quads_oblique", fem::Type::Quad4, Method::Embedded, 0.3},
                                           Case{"embedded_triangles", fem::Type::Tri3, Method::Embedded, 0.0},
                                           Case{"embedded_triangles_oblique", fem::Type::Tri3, Method::Embedded, 0.3}),
                         [](const auto& made) { return made.param.name; });

// Within an element the logarithm of the stiffness is nearly linear in the depth. A line that ended at its last node or segment would waver
// by 4 % along and 6 % across it on these meshes.
TEST_P(LineEndBy, StiffnessGrowsEvenlyWithTheDepth) {
  constexpr int nodes = 41, steps = 24;
  contact::Law law;
  image_file::AlignedBytes bytes;
  const model::Image image = image_of(GetParam(), nodes, law, bytes);
  Eigen::MatrixX3d powers(steps, 3);
  Eigen::MatrixX2d logarithm(steps, 2);
  for (int k = 0; k < steps; ++k) {
    const double depth_m = 0.0271 + 0.0075 * k / steps, scaled = 2.0 * k / steps - 1.0;
    const auto [along, across] = stiffness_n_per_m(image, GetParam().lean_rad, depth_m);
    powers.row(k) << 1.0, scaled, scaled * scaled;
    logarithm.row(k) << std::log(along), std::log(across);
  }
  const Eigen::MatrixX2d wavering = logarithm - powers * powers.colPivHouseholderQr().solve(logarithm);
  EXPECT_LT(wavering.col(0).lpNorm<Eigen::Infinity>(), 0.006);
  EXPECT_LT(wavering.col(1).lpNorm<Eigen::Infinity>(), 0.007);
}

TEST_P(LineEndBy, StiffnessIsNearlyThatOfFineElements) {
  contact::Law law, fine_law;
  image_file::AlignedBytes bytes, fine_bytes;
  const model::Image image = image_of(GetParam(), 41, law, bytes);
  const Case fine{"fine", fem::Type::Quad4, GetParam().method, GetParam().lean_rad};
  const model::Image fine_image = image_of(fine, 81, fine_law, fine_bytes);
  for (const double depth_m : {0.0264, 0.0270, 0.0277, 0.0283}) {
    const auto is = stiffness_n_per_m(image, GetParam().lean_rad, depth_m);
    const auto ought = stiffness_n_per_m(fine_image, GetParam().lean_rad, depth_m);
    EXPECT_NEAR(is[0] / ought[0], 1.0, 0.010) << depth_m;
    EXPECT_NEAR(is[1] / ought[1], 1.0, 0.012) << depth_m;
  }
}

// In tissue that is all but incompressible the two directions of a node hold each other: an end must not be held faster than that leaves.
TEST(LineEnd, LeavesTheComplianceDefinite) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4})
    for (const Method method : {Method::Adapt, Method::Embedded})
      for (const auto& [nodes, lean_rad] : {std::pair{28, 0.0}, {16, -0.54}, {35, -0.55}, {29, 0.07}}) {
        contact::Law law;
        image_file::AlignedBytes bytes;
        const model::Image image = image_of({"", type, method, lean_rad, fem::Model::PlaneStrain, 0.4999, 0.15}, nodes, law, bytes);
        const auto needle = std::make_unique<Insertion>();
        needle->open(image);
        for (double depth_m = 0.002; depth_m < 0.03; depth_m += 2.3e-4) {
          const double away_m = depth_m - needle_m;
          needle->step({0.0013 + away_m * std::sin(lean_rad), away_m * std::cos(lean_rad), 0.5 * std::numbers::pi - lean_rad}, 1e-3);
          const contact::Solver& solver = needle->working_set().solver();
          const auto n = static_cast<Eigen::Index>(solver.size());
          Eigen::MatrixXd compliance(2 * n, 2 * n);
          for (Eigen::Index i = 0; i < n; ++i)
            for (Eigen::Index j = 0; j < n; ++j) {
              const contact::Block g = solver.compliance(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
              compliance.block<2, 2>(2 * i, 2 * j) << g[0], g[1], g[2], g[3];
            }
          ASSERT_EQ(compliance.llt().info(), Eigen::Success)
              << static_cast<int>(type) << static_cast<int>(method) << ' ' << lean_rad << ' ' << depth_m;
        }
      }
}

// Leaning against the triangles' diagonals, the path crosses some of those that end at the surface nearer to that end.
TEST(Adapt, LeavesTheSurfaceWhereItIs) {
  std::size_t moved = 0;
  for (const double lean_rad : {-0.3, 0.3})
    for (const double entry_m : {-0.0012, -0.0007, 0.0003, 0.0008, 0.0011}) {
      const Case what{"leaning", fem::Type::Tri3, Method::Adapt, lean_rad};
      contact::Law law;
      image_file::AlignedBytes bytes;
      const model::Image image = image_of(what, 41, law, bytes);
      const auto needle = std::make_unique<Insertion>();
      needle->open(image);
      const double away_m = 0.02 - needle_m;
      const Pose base{entry_m + away_m * std::sin(lean_rad), away_m * std::cos(lean_rad), 0.5 * std::numbers::pi - lean_rad};
      EXPECT_EQ(needle->step(base, 1e-3).status, Status::Ok);
      const contact::Geometry& geometry = needle->working_set().geometry();
      for (std::uint32_t n = 0; n < image.tissue.node_m.size(); ++n) {
        if (!geometry.is_moved(n)) continue;
        ++moved;
        if (image.tissue.node_m[n][1] == 0.0) {
          EXPECT_LT(std::abs(geometry.node_m(n)[1]), 1e-12) << lean_rad << ' ' << entry_m;
        }
      }
    }
  EXPECT_GT(moved, 50u);
}

}  // namespace
}  // namespace trocar::insertion
