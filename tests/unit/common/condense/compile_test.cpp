#include "common/condense/compile.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "common/condense/float32_error.hpp"
#include "common/config/user_error.hpp"
#include "common/core/capacities.hpp"
#include "common/fem/assembly.hpp"
#include "common/fem/statics.hpp"
#include "scenes.hpp"

namespace trocar::condense {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::planar_scene;
using testing::solid_scene;

model::Image open(const Compiled& compiled) {
  model::Image image{};
  EXPECT_EQ(model::open(compiled.image.span(), image), model::ImageStatus::Ok);
  return image;
}

MatrixXd compliance64(const model::Image& image) {
  const auto n = static_cast<Index>(image.tissue.unknowns());
  return Eigen::Map<const MatrixXd>(image.tissue.compliance64.data(), n, n);
}

// The tissue as dense matrices, factored by other code than the compiler's.
struct Dense {
  MatrixXd k{};  // with supported rows and columns replaced by the identity
  std::vector<bool> fixed{};
  MatrixXd p{};  // supported rows zero

  Dense(const scene::Scene& s, const Plan& plan) {
    k = fem::assemble_stiffness(plan.mesh, s.tissue);
    fixed = fem::supported_degrees_of_freedom(plan.mesh, s.tissue.supports);
    p = plan.candidates.load;
    for (Index i = 0; i < k.rows(); ++i) {
      if (!fixed[static_cast<std::size_t>(i)]) continue;
      k.row(i).setZero();
      k.col(i).setZero();
      k(i, i) = 1.0;
      p.row(i).setZero();
    }
  }
};

// Exchange of known and unknown at index i (MODELS 3): S then maps (…, u_i, …) to (…, f_i, …).
void pivot(MatrixXd& s, Index i) {
  const double p = s(i, i);
  MatrixXd next = s - s.col(i) * s.row(i) / p;
  next.row(i) = -s.row(i) / p;
  next.col(i) = s.col(i) / p;
  next(i, i) = 1.0 / p;
  s = next;
}

class Condensed : public ::testing::TestWithParam<std::function<scene::Scene()>> {};

scene::Scene solid_tets() { return solid_scene(6e-3, fem::Type::Tet4); }
scene::Scene off_plane() {
  scene::Scene s = solid_scene(3e-3);
  s.plane_z_m = 0.0013;
  return s;
}
scene::Scene strain_bbar() {
  scene::Scene s = planar_scene(fem::Type::Quad4, 9);
  s.tissue.model = fem::Model::PlaneStrain;
  s.tissue.integration = fem::Integration::BBar;
  s.tissue.supports.push_back({fem::Side::XMin, {true, false, false}});
  return s;
}

INSTANTIATE_TEST_SUITE_P(Scenes, Condensed,
                         ::testing::Values([] { return planar_scene(fem::Type::Quad4); }, [] { return planar_scene(fem::Type::Tri3); },
                                           strain_bbar, [] { return solid_scene(); }, solid_tets, off_plane));

TEST_P(Condensed, ComplianceIsThatOfTheFullSystem) {
  const scene::Scene s = GetParam()();
  const Plan planned = plan(s);
  const MatrixXd c = compliance64(open(compile(s, planned)));
  const Dense dense(s, planned);
  const MatrixXd expected = dense.p.transpose() * dense.k.llt().solve(dense.p);
  EXPECT_LT((c - expected).cwiseAbs().maxCoeff(), 1e-10 * expected.cwiseAbs().maxCoeff());
  EXPECT_EQ((c - c.transpose()).cwiseAbs().maxCoeff(), 0.0);
}

// Some candidate displacements prescribed, forces on the others: by pivots of the condensed matrix, and by the full system with multipliers
// on its constraints P_S^T u = u_S.
TEST_P(Condensed, BoundaryConditionSetsAreThoseOfTheFullSystem) {
  const scene::Scene s = GetParam()();
  const Plan planned = plan(s);
  const MatrixXd c = compliance64(open(compile(s, planned)));
  const Dense dense(s, planned);
  std::vector<Index> free;
  for (Index i = 0; i < c.rows(); ++i)
    if (c(i, i) > 0.0) free.push_back(i);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> value(-1.0, 1.0);
  for (int trial = 0; trial < 6; ++trial) {
    std::shuffle(free.begin(), free.end(), random);
    const auto constrained = static_cast<Index>(1 + random() % 12);
    const std::vector<Index> in_s(free.begin(), free.begin() + constrained);
    VectorXd known(c.rows());  // forces, and displacements on S
    for (Index i = 0; i < known.size(); ++i) known(i) = value(random);
    for (const Index i : in_s) known(i) *= 1e-3;

    MatrixXd swept = c;
    for (const Index i : in_s) pivot(swept, i);
    const VectorXd found = swept * known;  // displacements, and forces on S

    const Index n = dense.k.rows();
    MatrixXd full = MatrixXd::Zero(n + constrained, n + constrained);
    VectorXd right = VectorXd::Zero(n + constrained);
    full.topLeftCorner(n, n) = dense.k;
    VectorXd forces = known;
    for (Index a = 0; a < constrained; ++a) {
      const Index i = in_s[static_cast<std::size_t>(a)];
      forces(i) = 0.0;
      full.block(0, n + a, n, 1) = -dense.p.col(i);
      full.block(n + a, 0, 1, n) = -dense.p.col(i).transpose();
      right(n + a) = -known(i);
    }
    right.head(n) = dense.p * forces;
    const VectorXd solution = full.partialPivLu().solve(right);
    const VectorXd displacement = dense.p.transpose() * solution.head(n);

    double u_scale = displacement.cwiseAbs().maxCoeff();
    double f_scale = solution.tail(constrained).cwiseAbs().maxCoeff();
    for (Index a = 0; a < constrained; ++a)
      EXPECT_NEAR(found(in_s[static_cast<std::size_t>(a)]), solution(n + a), 1e-10 * f_scale) << "trial " << trial;
    for (Index i = 0; i < c.rows(); ++i) {
      const bool constrained_here = std::find(in_s.begin(), in_s.end(), i) != in_s.end();
      if (!constrained_here) {
        EXPECT_NEAR(found(i), displacement(i), 1e-10 * u_scale) << "trial " << trial;
      }
    }
  }
}

TEST_P(Condensed, VisibleDisplacementsAreThoseOfTheFullSystem) {
  const scene::Scene s = GetParam()();
  const Plan planned = plan(s);
  const Compiled compiled = compile(s, planned);
  const Dense dense(s, planned);
  const MatrixXd expected = dense.k.llt().solve(dense.p);
  const Index dimension = planned.mesh.dimension();
  const auto rows = dimension * static_cast<Index>(planned.visible.node.size());
  ASSERT_GT(rows, 0);
  const auto* values =
      reinterpret_cast<const float*>(compiled.visible.span().data() + compiled.visible.span().size()) - rows * expected.cols();
  const MatrixXd stored = Eigen::Map<const Eigen::MatrixXf>(values, rows, expected.cols()).cast<double>();
  for (std::size_t v = 0; v < planned.visible.node.size(); ++v) {
    const auto at = static_cast<Index>(v) * dimension;
    const auto difference = stored.middleRows(at, dimension) - expected.middleRows(planned.visible.node[v] * dimension, dimension);
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-7 * expected.cwiseAbs().maxCoeff());
  }
}

TEST(Compile, ThinNeedleOnANodeIsANodalForce) {
  const scene::Scene s = solid_scene(1e-12);
  const Plan planned = plan(s);
  const MatrixXd c = compliance64(open(compile(s, planned)));
  const fem::Statics statics(planned.mesh, s.tissue);
  const fem::Locator locator(planned.mesh);
  for (const std::size_t node : {std::size_t{24}, std::size_t{17}}) {
    const auto& x = planned.candidates.node_m[node];
    const Index dof = 3 * locator.nearest_node({x[0], x[1], 0.0}) + 1;
    const double nodal = statics.solve(MatrixXd::Identity(statics.degrees_of_freedom(), statics.degrees_of_freedom()).col(dof))(dof);
    EXPECT_NEAR(c(static_cast<Index>(2 * node + 1), static_cast<Index>(2 * node + 1)), nodal, 1e-8 * nodal);
  }
}

TEST(Compile, CorridorIsTheSubmatrixOfTheWhole) {
  for (scene::Scene s : {planar_scene(fem::Type::Tri3), solid_scene(4e-3)}) {
    const Plan whole_plan = plan(s);
    const MatrixXd whole = compliance64(open(compile(s, whole_plan)));
    s.corridor = scene::Corridor{{0.003, 0.0}, {-0.006, 0.05}, 0.004};
    const Plan part_plan = plan(s);
    const MatrixXd part = compliance64(open(compile(s, part_plan)));
    ASSERT_LT(part.rows(), whole.rows());
    std::vector<Index> place;
    for (const auto& x : part_plan.candidates.node_m) {
      const auto& all = whole_plan.candidates.node_m;
      const auto at = std::find(all.begin(), all.end(), x);
      ASSERT_NE(at, all.end());
      for (Index axis = 0; axis < 2; ++axis) place.push_back(2 * (at - all.begin()) + axis);
    }
    EXPECT_LT((part - whole(place, place)).cwiseAbs().maxCoeff(), 1e-12 * whole.cwiseAbs().maxCoeff());
  }
}

TEST(Compile, Float32ErrorIsWhatItCauses) {
  for (scene::Scene s : {planar_scene(), solid_scene()}) {
    const Plan in64 = plan(s);
    const Compiled compiled64 = compile(s, in64);
    s.single_precision = true;
    const Compiled compiled32 = compile_to_memory(s);
    EXPECT_LT(compiled32.image.span().size(), compiled64.image.span().size());
    const model::Image image64 = open(compiled64);
    const model::Image image32 = open(compiled32);
    const MatrixXd c = compliance64(image64);
    const MatrixXd rounded = Eigen::Map<const Eigen::MatrixXf>(image32.tissue.compliance32.data(), c.rows(), c.cols()).cast<double>();
    double worst = 0.0;
    for (Index i = 0; i < c.rows(); ++i)
      for (Index j = 0; j < c.cols(); ++j)
        if (c(i, i) * c(j, j) > 0.0) worst = std::max(worst, std::abs(rounded(i, j) - c(i, j)) / std::sqrt(c(i, i) * c(j, j)));
    const MatrixXd h = reference_line(in64.candidates, s, in64.law.spacing_m);
    ASSERT_GE(h.cols(), 8);
    double force = 0.0;
    double scale = 0.0;
    for (Index axis = 0; axis < 2; ++axis) {
      VectorXd u = VectorXd::Zero(h.cols());
      for (Index i = axis; i < u.size(); i += 2) u(i) = 1.0;
      const VectorXd f = (h.transpose() * c * h).fullPivLu().solve(u);
      force = std::max(force, ((h.transpose() * rounded * h).fullPivLu().solve(u) - f).cwiseAbs().maxCoeff());
      scale = std::max(scale, f.cwiseAbs().maxCoeff());
    }
    for (const model::Image* image : {&image64, &image32}) {
      EXPECT_NEAR(image->float32_error.compliance, worst, 1e-3 * worst);
      EXPECT_NEAR(image->float32_error.force, force / scale, 1e-3 * force / scale);
    }
    EXPECT_GT(worst, 1e-9);
    EXPECT_LT(worst, 6.0e-8);  // half a unit in the last place
    EXPECT_GT(force / scale, 1e-9);
  }
}

TEST(Compile, GivesTheSameBytesAgain) {
  const scene::Scene s = solid_scene();
  const Compiled first = compile_to_memory(s);
  const Compiled second = compile_to_memory(s);
  EXPECT_TRUE(std::ranges::equal(first.image.span(), second.image.span()));
  EXPECT_TRUE(std::ranges::equal(first.visible.span(), second.visible.span()));
}

TEST(Compile, TakesTheMeshForTheSpacingOfContacts) {
  scene::Scene s = planar_scene();  // elements of 10 mm
  EXPECT_NEAR(open(compile_to_memory(s)).law->spacing_m, 0.010, 1e-12);
  EXPECT_EQ(open(compile_to_memory(s)).need.contacts, 10U);
  s.contact->spacing_m = 0.004;
  EXPECT_EQ(open(compile_to_memory(s)).law->spacing_m, 0.004);
  EXPECT_EQ(open(compile_to_memory(s)).need.contacts, 25U);
  s = planar_scene(fem::Type::Quad4, 101);  // of 1 mm: 100 contacts would be too many
  s.corridor = scene::Corridor{{0.0, 0.0}, {0.0, 0.1}, 0.001};
  const Plan planned = plan(s);
  EXPECT_EQ(planned.need.contacts, capacity::contacts);
  EXPECT_NEAR(planned.law.spacing_m, 0.1 / static_cast<double>(capacity::contacts), 1e-12);
}

void expect_refusal(const std::function<void(scene::Scene&)>& change, const std::vector<std::string>& words,
                    scene::Scene s = planar_scene()) {
  s.file = "some.toml";
  change(s);
  try {
    (void)compile_to_memory(s);
    ADD_FAILURE() << "not refused: " << words.front();
  } catch (const config::UserError& error) {
    const std::string said = error.what();
    EXPECT_EQ(said.rfind("some.toml: ", 0), 0U) << said;
    EXPECT_TRUE(said.find(';') != std::string::npos || said.find("such as") != std::string::npos) << "no remedy: " << said;
    for (const std::string& word : words) EXPECT_NE(said.find(word), std::string::npos) << "misses \"" << word << "\": " << said;
  }
}

TEST(Compile, RefusesByName) {
  expect_refusal([](auto& s) { s.needle.reset(); }, {"needle"});
  expect_refusal([](auto& s) { s.contact.reset(); }, {"contact"});
  expect_refusal([](auto& s) { s.needle->model = scene::NeedleModel::Thesis; }, {"needle.model", "offline"});
  expect_refusal(
      [](auto& s) {
        s.needle->bevel.angle_rad = 0.3;
        s.contact->method = contact::Method::Snap;
      },
      {"bevel_deg", "embedded", "symmetric"});
  expect_refusal(
      [](auto& s) {
        s.contact->explicit_count = 1;
        s.contact->explicit_point_m[0] = {0.0, 0.1};
      },
      {"contact.points_m[0]", "supported"});
  expect_refusal([](auto& s) { s.contact->method = contact::Method::Subdivide; }, {"subdivide"});
  expect_refusal([](auto& s) { s.contact->method = contact::Method::Adapt; }, {"adapt", "solid"}, solid_scene());
  expect_refusal([](auto& s) { s.tissue.strain = fem::Strain::GreenLagrange; }, {"green_lagrange"});
  expect_refusal([](auto& s) { s.contact->spacing_m = 0.001; }, {"contacts", "64", "spacing_m"});
  expect_refusal(
      [](auto& s) {
        s.contact->method = contact::Method::Snap;
        s.corridor = scene::Corridor{{0.0, 0.0}, {0.0, 0.1}, 0.001};
      },
      {"80 contacts", "64"}, planar_scene(fem::Type::Quad4, 81));
  expect_refusal(
      [](auto& s) {
        s.contact->explicit_count = 2;
        s.contact->explicit_point_m[0] = {0.0, 0.05};
        s.contact->explicit_point_m[1] = {0.0, -0.001};
      },
      {"points_m[1]", "outside of the tissue", "-0.001"});
  expect_refusal([](auto& s) { s.corridor = scene::Corridor{{0.3, 0.0}, {0.3, 0.1}, 0.01}; }, {"corridor"});
  expect_refusal([](auto& s) { s.tissue.supports.clear(); }, {"support"});
  expect_refusal([](auto& s) { s.tissue.zones[0].material.poisson = 0.5; }, {"0.5"});
  expect_refusal([](auto& s) { s.plane_z_m = 0.02; }, {"plane_z_m"}, solid_scene());
  expect_refusal([](auto& s) { s.needle->outer_m.reset(); }, {"outer_m"}, solid_scene());
  expect_refusal([](auto& s) { s.visible = std::string("nobody"); }, {"nobody"});
}

TEST(Compile, RefusesMoreMemoryThanAllowedBeforeItWorks) {
  scene::Scene s = planar_scene();
  s.file = "some.toml";
  bool worked = false;
  try {
    (void)compile_to_memory(s, {.most_memory_bytes = 100'000, .progress = [&](std::string_view, double) { worked = true; }});
    FAIL();
  } catch (const config::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("--memory"), std::string::npos);
  }
  EXPECT_FALSE(worked);
}

TEST(Compile, ReportsProgressAndStopsWhenToldTo) {
  std::vector<double> fractions;
  (void)compile_to_memory(planar_scene(), {.progress = [&](std::string_view phase, double fraction) {
                            if (phase == "solving columns") fractions.push_back(fraction);
                          }});
  EXPECT_EQ(fractions.size(), 1U + 4U);  // 242 columns in blocks of 64
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_EQ(fractions.back(), 1.0);
  EXPECT_THROW((void)compile_to_memory(planar_scene(), {.progress =
                                                            [](std::string_view, double fraction) {
                                                              if (fraction > 0.5) throw config::UserError("stopped");
                                                            }}),
               config::UserError);
}

}  // namespace
}  // namespace trocar::condense
