// The comparison partners that carry the whole mesh must give the forces and displacements of the condensed system.
#include "tests/benchmarks/partner/full_system.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/benchmarks/partner/sheet.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::partner {
namespace {

using reference::Axial;
using reference::Contact;
using reference::Random;

double relative(const Eigen::VectorXd& a, const Eigen::VectorXd& b) { return (a - b).norm() / b.norm(); }

struct FullSystem : testing::Test {
  Sheet sheet{make_sheet(21)};
  // Neighbours, a gap, and a node beside: entries between contacts and contacts alone.
  std::vector<int> nodes{[this] {
    std::vector<int> n = axis_nodes(sheet, 12);
    n.push_back(n[3] + 1);
    return n;
  }()};
  Eigen::MatrixXd g{compliance(sheet, nodes)};
  Random random{7};
  std::vector<Contact> target{};
  std::vector<Axial> state{};

  void draw(int stuck_of_three) {
    target.clear();
    state.clear();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double angle = random.uniform(-3.0, 3.0);
      target.push_back({{std::cos(angle), std::sin(angle)},
                        {random.uniform(-1e-3, 1e-3), random.uniform(-1e-3, 1e-3)},
                        -random.uniform(0.0, 0.3),
                        random.uniform(0.0, 0.3)});
      state.push_back(static_cast<int>(random.below(3)) < stuck_of_three ? Axial::Stuck
                      : random.below(2) == 0                             ? Axial::Upper
                                                                         : Axial::Lower);
    }
  }
  [[nodiscard]] Eigen::VectorXd condensed() const { return reference::solve_with_states({g, target}, state).force_n; }
  [[nodiscard]] Eigen::VectorXd everywhere(const Eigen::VectorXd& force) const {
    Eigen::VectorXd load = Eigen::VectorXd::Zero(sheet.statics->degrees_of_freedom());
    for (std::size_t i = 0; i < nodes.size(); ++i) load.segment<2>(2 * nodes[i]) = force.segment<2>(static_cast<Eigen::Index>(2 * i));
    const Eigen::VectorXd u = sheet.statics->solve(load);
    Eigen::VectorXd free(sheet.stiffness.rows());
    for (std::size_t k = 0; k < sheet.row.size(); ++k)
      if (sheet.row[k] >= 0) free(sheet.row[k]) = u(static_cast<Eigen::Index>(k));
    return free;
  }
};

TEST_F(FullSystem, RefactoredEqualsCondensed) {
  RefactoredSystem full(sheet.stiffness, contact_nodes(sheet, nodes));
  for (int trial = 0; trial < 12; ++trial) {
    draw(trial % 4);
    full.solve(target, state);
    const Eigen::VectorXd exact = condensed();
    EXPECT_LT(relative(full.force_n(), exact), 1e-10) << trial;
    EXPECT_LT(relative(full.displacement_m(), everywhere(exact)), 1e-10) << trial;
  }
}

TEST_F(FullSystem, ReusedFactorEqualsCondensed) {
  ReusedFactor full(sheet.stiffness, contact_nodes(sheet, nodes));
  for (int trial = 0; trial < 12; ++trial) {
    draw(trial % 4);
    const Eigen::VectorXd exact = condensed();
    EXPECT_LT(full.solve_by_iterations(target, state, 1e-13), 150);
    EXPECT_LT(relative(full.force_n(), exact), 1e-10) << trial;
    EXPECT_LT(relative(full.displacement_m(), everywhere(exact)), 1e-10) << trial;
    full.solve_by_columns(target, state);
    EXPECT_LT(relative(full.force_n(), exact), 1e-10) << trial;
    EXPECT_LT(relative(full.displacement_m(), everywhere(exact)), 1e-10) << trial;
    full.displace();
    EXPECT_LT(relative(full.displacement_m(), everywhere(exact)), 1e-10) << trial;
  }
}

TEST_F(FullSystem, RefusesAContactOnASupport) {
  EXPECT_THROW(RefactoredSystem(sheet.stiffness, {{-1, -1}}), std::runtime_error);
  EXPECT_THROW(ReusedFactor(sheet.stiffness, {{-1, -1}}), std::runtime_error);
}

}  // namespace
}  // namespace trocar::partner
