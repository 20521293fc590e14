#include "common/fem/statics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <set>

#include "models.hpp"

namespace trocar::fem {
namespace {

using testing::block;
using testing::distorted;
using testing::graded_grid;
using testing::message_of;
using testing::poisson;
using testing::young;

struct Case {
  Type type;
  Model model;
  Integration integration;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << static_cast<int>(c.type) << ' ' << static_cast<int>(c.model) << ' ' << static_cast<int>(c.integration);
}

class EachKind : public ::testing::TestWithParam<Case> {
 protected:
  Tissue tissue() const {
    Tissue t = block(graded_grid(GetParam().type));
    t.model = GetParam().model;
    t.integration = GetParam().integration;
    return t;
  }
};
INSTANTIATE_TEST_SUITE_P(
    Statics, EachKind,
    ::testing::Values(Case{Type::Tri3, Model::PlaneStress, Integration::Full}, Case{Type::Tri3, Model::PlaneStrain, Integration::Full},
                      Case{Type::Quad4, Model::PlaneStress, Integration::Full}, Case{Type::Quad4, Model::PlaneStrain, Integration::BBar},
                      Case{Type::Tet4, Model::Solid, Integration::Full}, Case{Type::Hex8, Model::Solid, Integration::Full},
                      Case{Type::Hex8, Model::Solid, Integration::BBar}));

Eigen::MatrixXd some_loads(Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd loads(rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j)
    for (Eigen::Index i = 0; i < rows; ++i) loads(i, j) = std::sin(1.0 + 3.1 * static_cast<double>(i) + 7.7 * static_cast<double>(j));
  return loads;
}

// The same K, solved densely by another algorithm.
TEST_P(EachKind, EqualsTheDenseSolution) {
  const Mesh mesh = distorted(graded_grid(GetParam().type));
  const Statics statics(mesh, tissue());
  const Eigen::Index size = statics.degrees_of_freedom();
  ASSERT_EQ(size, static_cast<Eigen::Index>(mesh.node.size()) * mesh.dimension());
  Eigen::MatrixXd k = statics.stiffness_n_per_m();
  EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), 1e-14 * k.cwiseAbs().maxCoeff());
  Eigen::MatrixXd loads = some_loads(size, 70);
  Eigen::MatrixXd expected = loads;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (!statics.supported(i)) continue;
    k.row(i).setZero();
    k.col(i).setZero();
    k(i, i) = 1.0;
    expected.row(i).setZero();
  }
  expected = k.ldlt().solve(expected).eval();
  const double scale = expected.cwiseAbs().maxCoeff();
  EXPECT_LT((statics.solve(loads) - expected).cwiseAbs().maxCoeff(), 1e-10 * scale);
}

// Linear displacement on the whole boundary must be met exactly inside, on distorted elements too.
TEST_P(EachKind, PassesThePatchTest) {
  Tissue t = tissue();
  const Mesh mesh = distorted(*t.grid);
  const bool solid = mesh.dimension() == 3;
  t.supports.clear();
  for (const Side side : {Side::XMin, Side::XMax, Side::YMin, Side::YMax}) t.supports.push_back({side, {true, true, solid}});
  if (solid)
    for (const Side side : {Side::ZMin, Side::ZMax}) t.supports.push_back({side, {true, true, true}});
  const Statics statics(mesh, t);
  Eigen::Matrix3d gradient;
  gradient << 0.3, -0.2, 0.15, 0.1, 0.4, -0.25, -0.05, 0.2, 0.35;
  Eigen::VectorXd linear(statics.degrees_of_freedom());
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const Eigen::Vector3d u = gradient * Eigen::Vector3d(mesh.node[n][0], mesh.node[n][1], mesh.node[n][2]);
    for (int a = 0; a < mesh.dimension(); ++a) linear[static_cast<Eigen::Index>(n) * mesh.dimension() + a] = u[a];
  }
  const Eigen::VectorXd u = statics.solve(Eigen::VectorXd::Zero(linear.size()), linear);
  EXPECT_LT((u - linear).cwiseAbs().maxCoeff(), 1e-12 * linear.cwiseAbs().maxCoeff());
}

// What the supports hold is what was applied: forces and the moment about the origin (about z in the plane).
TEST_P(EachKind, ReactionsBalanceTheLoads) {
  const Mesh mesh = distorted(graded_grid(GetParam().type));
  const Statics statics(mesh, tissue());
  const int d = mesh.dimension();
  const Eigen::VectorXd load = some_loads(statics.degrees_of_freedom(), 1);
  const Eigen::VectorXd internal = statics.stiffness_n_per_m() * statics.solve(load);
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int a = 0; a < d; ++a) sum[a] = internal[static_cast<Eigen::Index>(n) * d + a];
    for (int a = 0; a < d; ++a) {
      const Eigen::Index i = static_cast<Eigen::Index>(n) * d + a;
      if (!statics.supported(i)) {
        EXPECT_NEAR(internal[i], load[i], 1e-11);
      }
    }
    force += sum;
    moment += Eigen::Vector3d(mesh.node[n][0], mesh.node[n][1], mesh.node[n][2]).cross(sum);
  }
  EXPECT_LT(force.norm(), 1e-11);
  EXPECT_LT(moment.norm(), 1e-11);
}

TEST_P(EachKind, ColumnsEqualSingleSolutionsInBlocksOfAnySize) {
  const Mesh mesh = structured_grid(graded_grid(GetParam().type));
  const Statics statics(mesh, tissue());
  const Eigen::Index size = statics.degrees_of_freedom();
  Eigen::SparseMatrix<double> loads(size, size + 1);
  for (Eigen::Index i = 0; i < size; ++i) loads.insert(i, i) = 1.0;
  for (Eigen::Index i = 0; i < size; i += 3) loads.insert(i, size) = 0.1 * static_cast<double>(i);
  const Eigen::MatrixXd expected = statics.solve(Eigen::MatrixXd(loads));
  EXPECT_LT((expected.leftCols(size) - expected.leftCols(size).transpose()).cwiseAbs().maxCoeff(), 1e-13 * expected.cwiseAbs().maxCoeff());
  for (const Eigen::Index block_size : {Eigen::Index{1}, Eigen::Index{7}, Eigen::Index{64}, size + 1}) {
    Eigen::MatrixXd found = Eigen::MatrixXd::Constant(size, size + 1, std::nan(""));
    std::set<Eigen::Index> firsts;
    statics.solve_columns(loads, block_size, [&](Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& u) {
      EXPECT_TRUE(firsts.insert(first).second);
      found.middleCols(first, u.cols()) = u;
    });
    EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-13 * expected.cwiseAbs().maxCoeff()) << block_size;
    Eigen::MatrixXd again = found;
    statics.solve_columns(loads, block_size, [&](Eigen::Index first, const auto& u) { again.middleCols(first, u.cols()) = u; });
    EXPECT_EQ(again, found) << "not repeatable, block " << block_size;

    // A few rows alone: the same bits there, nothing elsewhere.
    std::vector<bool> wanted(static_cast<std::size_t>(size), false);
    for (std::size_t i = 0; i < wanted.size(); i += 11) wanted[i] = true;
    again.setConstant(std::nan(""));
    statics.solve_columns(loads, block_size, wanted, [&](Eigen::Index first, const auto& u) { again.middleCols(first, u.cols()) = u; });
    for (Eigen::Index i = 0; i < size; ++i) {
      if (wanted[static_cast<std::size_t>(i)]) {
        EXPECT_EQ(again.row(i), found.row(i));
      } else {
        EXPECT_TRUE((again.row(i).array() == 0.0).all());
      }
    }
  }
}

TEST(Statics, FailureInTheSinkEndsTheCall) {
  const Tissue t = block(graded_grid(Type::Quad4));
  const Statics statics(make_mesh(t), t);
  Eigen::SparseMatrix<double> loads(statics.degrees_of_freedom(), 20);
  for (Eigen::Index i = 0; i < 20; ++i) loads.insert(i, i) = 1.0;
  int calls = 0;
  EXPECT_THROW(statics.solve_columns(loads, 1,
                                     [&](Eigen::Index, const auto&) {
                                       if (++calls == 3) throw Error("disk full");
                                     }),
               Error);
  EXPECT_EQ(calls, 3);
}

// A uniform pull on the lower side, the upper one sliding: closed form with the model's own E and nu, on distorted elements.
TEST_P(EachKind, StretchesUniformlyAsInClosedForm) {
  Tissue t = tissue();
  const Mesh mesh = distorted(*t.grid);
  const int d = mesh.dimension();
  const Box bounds = bounding_box(mesh);
  Box corner{bounds.min_m, bounds.min_m};
  corner.min_m[1] = corner.max_m[1] = bounds.max_m[1];
  Box other = corner;
  other.min_m[0] = other.max_m[0] = bounds.max_m[0];
  t.supports = {{Side::YMax, {false, true, false}}, {corner, {true, false, d == 3}}};
  if (d == 3) t.supports.push_back({other, {false, false, true}});
  const Statics statics(mesh, t);
  const double pull = 100.0;  // Pa
  // Tributary area of each node on the lower side, from the axes.
  Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
  const auto share = [](const std::vector<double>& axis, double x) {
    for (std::size_t i = 0; i < axis.size(); ++i)
      if (axis[i] == x) return 0.5 * (axis[std::min(i + 1, axis.size() - 1)] - axis[i == 0 ? 0 : i - 1]);
    return 0.0;
  };
  for (const int n : nodes_at(mesh, Side::YMin)) {
    const Point& x = mesh.node[static_cast<std::size_t>(n)];
    load[n * d + 1] = -pull * share(t.grid->axis_m[0], x[0]) * (d == 3 ? share(t.grid->axis_m[2], x[2]) : t.thickness_m);
  }
  if (t.grid->element == Type::Tet4) {  // faces are triangles: a node's share is a third of those around it
    load.setZero();
    const std::set<int> lower = [&] {
      const auto nodes = nodes_at(mesh, Side::YMin);
      return std::set<int>(nodes.begin(), nodes.end());
    }();
    for (const auto& e : mesh.element) {
      std::vector<int> face;
      for (std::size_t k = 0; k < 4; ++k)
        if (lower.contains(e[k])) face.push_back(e[k]);
      if (face.size() != 3) continue;
      std::array<Eigen::Vector3d, 3> p;
      for (std::size_t k = 0; k < 3; ++k) {
        const Point& x = mesh.node[static_cast<std::size_t>(face[k])];
        p[k] = {x[0], x[1], x[2]};
      }
      for (const int n : face) load[n * d + 1] -= pull * (p[1] - p[0]).cross(p[2] - p[0]).norm() / 6.0;
    }
  }
  const Eigen::VectorXd u = statics.solve(load);
  const bool strain_model = t.model == Model::PlaneStrain;
  const double e = strain_model ? young / (1 - poisson * poisson) : young;
  const double nu = strain_model ? poisson / (1 - poisson) : poisson;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const auto row = static_cast<Eigen::Index>(n) * d;
    EXPECT_NEAR(u[row], -nu * pull / e * (mesh.node[n][0] - bounds.min_m[0]), 1e-13);
    EXPECT_NEAR(u[row + 1], pull / e * (mesh.node[n][1] - bounds.max_m[1]), 1e-13);
    if (d == 3) {
      EXPECT_NEAR(u[row + 2], -nu * pull / e * (mesh.node[n][2] - bounds.min_m[2]), 1e-13);
    }
  }
}

// Quads mirror a straight push exactly; triangles with one diagonal do not (and must not be mistaken for broken).
TEST(Statics, StraightPushStaysOnTheAxisWithQuadsOnly) {
  for (const Type type : {Type::Quad4, Type::Tri3}) {
    Tissue t = block(uniform_grid(type, {-0.05, 0.18, 0.0}, {0.1, 0.1, 0.0}, {9, 9, 1}));
    const Statics statics(make_mesh(t), t);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
    load(2 * 4 + 1) = 1.0;
    const double sideways = std::abs(statics.solve(load)(2 * 4));
    if (type == Type::Quad4)
      EXPECT_LT(sideways, 1e-12);
    else
      EXPECT_GT(sideways, 1e-6);
  }
}

// A slender cantilever of quads in shear approaches Timoshenko's tip deflection under refinement.
TEST(Statics, CantileverConvergesToBeamTheory) {
  const double length = 0.1;
  const double height = 0.01;
  const double thickness = 0.011;
  const double inertia = thickness * height * height * height / 12;
  const double shear = young / (2 * (1 + poisson));
  const double exact = length * length * length / (3 * young * inertia) + length / (5.0 / 6.0 * shear * height * thickness);
  double error = 1.0;
  for (const int refinement : {2, 4, 8}) {
    Tissue t = block(uniform_grid(Type::Quad4, {}, {length, height, 0.0}, {10 * refinement + 1, refinement + 1, 1}));
    t.thickness_m = thickness;
    t.supports = {{Side::XMin, {true, true, false}}};
    const Statics statics(make_mesh(t), t);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
    for (int j = 0; j <= refinement; ++j)
      load(2 * ((j + 1) * (10 * refinement + 1) - 1) + 1) = (j == 0 || j == refinement ? 0.5 : 1.0) / refinement;
    const double now = std::abs(statics.solve(load)(2 * (10 * refinement) + 1) - exact) / exact;
    EXPECT_LT(now, 0.5 * error);
    error = now;
  }
  EXPECT_LT(error, 0.02);
}

TEST(Statics, StiffZoneScalesTheAnswer) {
  Tissue soft = block(graded_grid(Type::Hex8));
  Tissue stiff = soft;
  stiff.zones.push_back({{10 * young, poisson}, Box{}, {}});
  const Mesh mesh = make_mesh(soft);
  const Eigen::MatrixXd load = some_loads(static_cast<Eigen::Index>(3 * mesh.node.size()), 1);
  const Eigen::VectorXd a = Statics(mesh, soft).solve(load);
  const Eigen::VectorXd b = Statics(mesh, stiff).solve(load);
  EXPECT_LT((a - 10 * b).cwiseAbs().maxCoeff(), 1e-12 * a.cwiseAbs().maxCoeff());
}

// Six decades between layers and nearly incompressible: still no reason to refuse, and the answer satisfies K u = f.
TEST(Statics, TakesStiffnessRatiosOfAMillion) {
  Tissue t = block(graded_grid(Type::Hex8));
  t.integration = Integration::BBar;
  t.zones = {{{1e3, 0.4999}, {}, {}}, {{1e9, 0.4999}, Box{{-1, -1, -1}, {1, 0.03, 1}}, {}}};
  const Statics statics(make_mesh(t), t);
  const Eigen::VectorXd load = some_loads(statics.degrees_of_freedom(), 1);
  const Eigen::VectorXd rest = statics.stiffness_n_per_m() * statics.solve(load) - load;
  for (Eigen::Index i = 0; i < rest.size(); ++i)
    if (!statics.supported(i)) {
      EXPECT_NEAR(rest[i], 0.0, 1e-3);
    }
}

std::string refusal(const Mesh& mesh, const Tissue& tissue) {
  return message_of([&] { const Statics statics(mesh, tissue); });
}

TEST(Statics, NamesTheMotionThatIsFreeInThePlane) {
  const Tissue good = block(graded_grid(Type::Quad4));
  const Mesh mesh = make_mesh(good);
  EXPECT_EQ(refusal(mesh, good), "");
  Tissue bad = good;
  const auto with = [&](std::vector<Support> supports) {
    bad.supports = std::move(supports);
    return refusal(mesh, bad);
  };
  EXPECT_NE(with({}).find("the mesh is unsupported: it can still move along x, move along y, rotate as a rigid body"), std::string::npos)
      << with({});
  EXPECT_NE(with({{Side::YMax, {false, true, false}}}).find("still move along x as"), std::string::npos);
  EXPECT_NE(with({{Side::XMin, {true, false, false}}}).find("still move along y as"), std::string::npos);
  const Box corner{{-0.05, 0.0, 0.0}, {-0.05, 0.0, 0.0}};
  EXPECT_NE(with({{corner, {true, true, false}}}).find("still rotate as"), std::string::npos);
  EXPECT_EQ(with({{corner, {true, true, false}}, {Side::YMax, {true, false, false}}}), "");
}

TEST(Statics, NamesTheMotionThatIsFreeInSpace) {
  const Tissue good = block(graded_grid(Type::Hex8));
  const Mesh mesh = make_mesh(good);
  Tissue bad = good;
  const auto with = [&](std::vector<Support> supports) {
    bad.supports = std::move(supports);
    return refusal(mesh, bad);
  };
  EXPECT_NE(with({{Side::ZMin, {false, false, true}}}).find("still move along x, move along y, rotate about z as"), std::string::npos);
  EXPECT_NE(with({{Side::XMax, {true, false, false}}}).find("still move along y, move along z, rotate about x as"), std::string::npos);
  const Box edge{{-0.05, 0.0, -1.0}, {-0.05, 0.0, 1.0}};  // along z: a hinge
  EXPECT_NE(with({{edge, {true, true, true}}}).find("still rotate about z as"), std::string::npos) << with({{edge, {true, true, true}}});
  const Box corner{{-0.05, 0.0, 0.0}, {-0.05, 0.0, 0.0}};
  EXPECT_NE(with({{corner, {true, true, true}}}).find("rotate about x, rotate about y, rotate about z as"), std::string::npos);
  EXPECT_EQ(with({{Side::XMin, {true, false, false}}, {Side::YMin, {false, true, false}}, {Side::ZMin, {false, false, true}}}), "");
}

// Two blocks side by side, of which one is held; then joined by a single node.
TEST(Statics, FindsAPartThatNothingHolds) {
  Tissue t = block(uniform_grid(Type::Quad4, {}, {0.1, 0.1, 0.0}, {4, 4, 1}));
  t.supports = {{Side::XMin, {true, true, false}}};
  Mesh mesh = make_mesh(t);
  const Mesh second = structured_grid(uniform_grid(Type::Quad4, {0.1, 0.1, 0.0}, {0.1, 0.1, 0.0}, {4, 4, 1}));
  const int joint = 15;  // upper right node of the first, where the second begins
  Mesh apart = mesh;
  Mesh hinged = mesh;
  for (const auto& e : second.element) {
    std::array<int, 8> moved = e;
    std::array<int, 8> tied = e;
    for (std::size_t k = 0; k < 4; ++k) {
      moved[k] = e[k] + 16;
      tied[k] = e[k] == 0 ? joint : e[k] + 15;
    }
    apart.element.push_back(moved);
    hinged.element.push_back(tied);
  }
  apart.node.insert(apart.node.end(), second.node.begin(), second.node.end());
  hinged.node.insert(hinged.node.end(), second.node.begin() + 1, second.node.end());
  EXPECT_NE(refusal(apart, t).find("16 nodes around (0.100000, 0.100000, 0.000000) m that share no node with the rest, is unsupported"),
            std::string::npos)
      << refusal(apart, t);
  EXPECT_NE(refusal(hinged, t).find("like a hinge"), std::string::npos) << refusal(hinged, t);
  Tissue held = t;
  held.supports.push_back({Side::XMax, {true, true, false}});
  EXPECT_EQ(refusal(apart, held), "");
  EXPECT_EQ(refusal(hinged, held), "");
}

TEST(Statics, NamesWhatIsWrongWithAModel) {
  const Tissue good = block(graded_grid(Type::Quad4));
  const Mesh mesh = make_mesh(good);
  Tissue bad = good;
  bad.supports = {{Box{{1.0, 1.0, 0.0}, {2.0, 2.0, 0.0}}, {true, true, false}}};
  EXPECT_EQ(refusal(mesh, bad), "support 1 holds no node; its box must contain nodes of the mesh");
  bad.supports = {{Side::YMax, {false, false, false}}};
  EXPECT_EQ(refusal(mesh, bad), "support 1 fixes no axis");
  bad.supports = {{Side::YMax, {true, true, true}}};
  EXPECT_NE(refusal(mesh, bad).find("fixes z"), std::string::npos);
  bad.supports = {{std::string("rib"), {true, true, false}}};
  EXPECT_NE(refusal(mesh, bad).find("no group \"rib\""), std::string::npos);

  bad = good;
  bad.zones[0].material.poisson = 0.5;
  EXPECT_NE(refusal(mesh, bad).find("poisson"), std::string::npos);
  bad.zones[0].material = {-1.0, 0.3};
  EXPECT_NE(refusal(mesh, bad).find("young_pa"), std::string::npos);
  bad.zones.clear();
  EXPECT_NE(refusal(mesh, bad).find("no material at"), std::string::npos);
  bad = good;
  bad.thickness_m = 0.0;
  EXPECT_NE(refusal(mesh, bad).find("thickness_m"), std::string::npos);
  bad = good;
  bad.model = Model::Solid;
  EXPECT_NE(refusal(mesh, bad).find("tet4 or hex8"), std::string::npos);

  Mesh inverted = mesh;
  std::swap(inverted.element[5][1], inverted.element[5][3]);
  EXPECT_NE(refusal(inverted, good).find("element 5"), std::string::npos);
}

}  // namespace
}  // namespace trocar::fem
