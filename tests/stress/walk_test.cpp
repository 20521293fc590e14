// Random walks of the needle through tissue, ordinary and hostile, by every method.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "walk.hpp"

namespace trocar::stress {
namespace {

using contact::Method;

constexpr std::array<Method, 3> methods{Method::Embedded, Method::Snap, Method::Adapt};

[[nodiscard]] Outcome walk_in(const reference::GridImage& grid, const contact::Law& law, const Walk& walk, std::uint64_t seed, long ticks) {
  model::Image image = grid.image();
  image.law = &law;
  return walk_through(image, walk, seed, ticks);
}

// The same through every method, from a law.
void walk_by_every_method(const reference::GridImage& grid, contact::Law law, const Walk& walk, long ticks, long allowed_not_ok = 0) {
  for (const Method method : methods) {
    SCOPED_TRACE("method " + std::to_string(static_cast<int>(method)));
    law.method = method;
    const Outcome outcome = walk_in(grid, law, walk, 1 + static_cast<std::uint64_t>(method), ticks);
    expect_sound(outcome);
    EXPECT_LE(outcome.not_ok, allowed_not_ok);
    EXPECT_GT(outcome.most_contacts, 3u);
  }
}

const reference::GridImage& soft(fem::Type type) {
  static const reference::GridImage tri({.element = fem::Type::Tri3});
  static const reference::GridImage quad(reference::Block{});
  return type == fem::Type::Tri3 ? tri : quad;
}

TEST(WalkStress, InAndOutOfTissueOfTriangles) {
  walk_by_every_method(soft(fem::Type::Tri3), soft(fem::Type::Tri3).law, {}, counts(100'000, 1'000'000));
}

TEST(WalkStress, InAndOutOfTissueOfQuads) {
  walk_by_every_method(soft(fem::Type::Quad4), soft(fem::Type::Quad4).law, {}, counts(100'000, 1'000'000));
}

TEST(WalkStress, WithJumpsOfTheBase) {
  walk_by_every_method(soft(fem::Type::Quad4), soft(fem::Type::Quad4).law, {.jump_m = 0.01}, counts(50'000, 1'000'000));
}

TEST(WalkStress, SameInputsGiveTheSameBits) {
  for (const Method method : methods) {
    contact::Law law = soft(fem::Type::Tri3).law;
    law.method = method;
    const auto run = [&] { return walk_in(soft(fem::Type::Tri3), law, {.jump_m = 0.01}, 5, 5000).fingerprint; };
    EXPECT_EQ(run(), run());
  }
}

TEST(WalkStress, ThroughLayersAMillionTimesStiffer) {
  reference::Block block;
  block.nodes_x = block.nodes_y = 17;
  block.zones = {{{25e3, 0.45}, {}, {}},
                 {{25e9, 0.45}, fem::Box{{-1.0, 0.03, -1.0}, {1.0, 0.05, 1.0}}, {}},
                 {{25e6, 0.45}, fem::Box{{-1.0, 0.07, -1.0}, {1.0, 1.0, 1.0}}, {}}};
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4}) {
    block.element = type;
    const reference::GridImage grid(block);
    walk_by_every_method(grid, grid.law, {}, counts(10'000, 200'000));
  }
}

TEST(WalkStress, ThroughNearlyIncompressibleTissue) {
  for (const auto& [model, integration] : {std::pair{fem::Model::PlaneStress, element::Integration::Full},
                                           {fem::Model::PlaneStrain, element::Integration::Full},
                                           {fem::Model::PlaneStrain, element::Integration::BBar}}) {
    for (const double poisson : {0.0, 0.4999}) {
      reference::Block block;
      block.nodes_x = block.nodes_y = 17;
      block.model = model;
      block.integration = integration;
      block.zones = {{{25.3e3, poisson}, {}, {}}};
      const reference::GridImage grid(block);
      walk_by_every_method(grid, grid.law, {}, counts(10'000, 100'000));
    }
  }
}

// Columns of cells a thousandth as wide as their neighbours, right where the needle runs.
TEST(WalkStress, ThroughSlivers) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4}) {
    constexpr int nodes = 17;
    const fem::Grid axes = fem::uniform_grid(type, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {nodes, nodes, 1});
    fem::Mesh mesh = fem::structured_grid(axes);
    const double edge = 0.1 / (nodes - 1);
    for (fem::Point& node : mesh.node) {
      const double column = std::round((node[0] + 0.05) / edge);
      if (column == 7.0) node[0] = -1e-3 * edge;
      if (column == 9.0) node[0] = 1e-3 * edge;
    }
    fem::Tissue tissue;
    tissue.thickness_m = 0.011;
    tissue.zones = {{{25.3e3, 0.48}, {}, {}}};
    tissue.supports = {{fem::Side::YMax, {true, true, false}}};
    const reference::GridImage grid(std::move(mesh), tissue, edge);
    walk_by_every_method(grid, grid.law, {}, counts(10'000, 200'000));
  }
}

TEST(WalkStress, WithThresholdsOfZero) {
  contact::Law law = soft(fem::Type::Quad4).law;
  law.shaft_n_per_m = law.tip_n_per_m = 0.0;
  walk_by_every_method(soft(fem::Type::Quad4), law, {}, counts(10'000, 200'000));
}

// Nothing ever slips, so nothing may enter: the tissue is dragged along, and torn out of all proportion.
TEST(WalkStress, WithThresholdsBeyondAllMeasure) {
  contact::Law law = soft(fem::Type::Quad4).law;
  for (const double density : {1e4, 1e12}) {
    law.shaft_n_per_m = density;
    law.tip_n_per_m = 2 * density;
    for (const Method method : methods) {
      law.method = method;
      const Outcome outcome = walk_in(soft(fem::Type::Quad4), law, {}, 9, counts(10'000, 200'000));
      EXPECT_TRUE(outcome.finite);
      EXPECT_LE(outcome.worst_residual_n, contact::Solver::tolerance_n);
      EXPECT_LE(outcome.most_pivots, contact::Solver::max_pivots);
      EXPECT_LT(outcome.drift, 1e-9);
      EXPECT_EQ(outcome.allocations, 0u);
    }
  }
}

TEST(WalkStress, WithExplicitContactsANanometreApart) {
  const reference::GridImage& grid = soft(fem::Type::Tri3);
  contact::Law law = grid.law;
  law.explicit_count = 12;
  for (std::size_t i = 0; i < law.explicit_count; ++i) {
    law.explicit_point_m[i] = {0.0, 0.01 + 0.012 * static_cast<double>(i / 2) + 1e-9 * static_cast<double>(i % 2)};
    law.explicit_slip_force_n[i] = 0.02 * static_cast<double>(1 + i % 3);
  }
  model::Image image = grid.image();
  image.law = &law;
  const auto model = std::make_unique<insertion::Insertion>();
  model->open(image);
  const double needle_m = image.needle.length_m;
  ASSERT_EQ(model->step({0.0, -0.01 - needle_m, std::numbers::pi / 2}, 1e-3).status, insertion::Status::Ok);
  Walker walker(11, {}, needle_m);
  // Neighbours that cannot be told apart to rounding (their compliance is singular to 1e-12) may trade states until the bound on pivots:
  // then the step says so, seldom, and the forces keep within their bounds.
  long unsolved = 0;
  const long ticks = counts(50'000, 1'000'000);
  for (long tick = 0; tick < ticks; ++tick) {
    const insertion::Result result = model->step(walker.next(), 1e-3);
    ASSERT_LE(result.pivots, contact::Solver::max_pivots);
    ASSERT_TRUE(std::isfinite(result.base.fy_n));
    if (result.status != insertion::Status::Ok) {
      ASSERT_TRUE(result.status == insertion::Status::PivotLimit || result.status == insertion::Status::IllConditioned) << tick;
      ++unsolved;
      continue;
    }
    ASSERT_LE(result.residual_n, contact::Solver::tolerance_n);
    ASSERT_LE(breach_n(*model, law), 2e-9);
  }
  EXPECT_LE(unsolved, ticks / 1'000);
  EXPECT_EQ(model->working_set().solver().factor_drift(), 0.0);
}

}  // namespace
}  // namespace trocar::stress
