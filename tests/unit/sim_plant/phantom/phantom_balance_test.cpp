// The condensed phantom against the whole finite-element model that it came from.
#include <gtest/gtest.h>

#include <cmath>

#include "common/fem/statics.hpp"
#include "scene.hpp"

namespace trocar::sim_plant {
namespace {

TEST(PhantomBalance, ContactForcesPutTheWholeMeshOntoTheNeedle) {
  for (const fem::Type element : {fem::Type::Quad4, fem::Type::Tri3}) {
    PhantomConfig config = scene();
    config.tissue.grid = square(21, element);
    Hand hand(config);
    hand.move(-0.004, 0.06, 0.06);
    hand.move(0.002, -0.004, -0.03);
    const Phantom& phantom = hand.phantom;
    ASSERT_GT(phantom.contacts(), 5u);

    const fem::Statics statics(fem::make_mesh(config.tissue), config.tissue);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
    const double c = std::cos(hand.pose[2]);
    const double s = std::sin(hand.pose[2]);
    const auto force = [&](const ContactForce& f) {
      return Eigen::Vector2d(c * f.axial_n - s * f.lateral_n, s * f.axial_n + c * f.lateral_n);
    };
    for (std::size_t i = 0; i < phantom.contacts(); ++i) {
      const Phantom::Contact contact = phantom.contact(i);
      const Embedding at = locate(plane_grid(config.tissue), contact.material_m);
      for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k)
        load.segment<2>(2 * at.node[k]) += at.weight[k] * force(contact.force);
    }
    const Eigen::VectorXd u = statics.solve(load);
    const auto deformed = [&](const Point& material) {
      const Embedding at = locate(plane_grid(config.tissue), material);
      Eigen::Vector2d x(material[0], material[1]);
      for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k) x += at.weight[k] * u.segment<2>(2 * at.node[k]);
      return x;
    };

    const Eigen::Vector2d base(hand.pose[0], hand.pose[1]);
    Eigen::Vector3d wrench = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < phantom.contacts(); ++i) {
      const Phantom::Contact contact = phantom.contact(i);
      const Eigen::Vector2d from_base = deformed(contact.material_m) - base;
      // The regularisation is worth a micrometre at most; the last contact's tie is soft by design.
      EXPECT_NEAR(c * from_base(0) + s * from_base(1), contact.arclength_m, 2e-6) << i;
      EXPECT_NEAR(-s * from_base(0) + c * from_base(1), -contact.force.lateral_gap_m, 2e-6) << i;
      if (i + 1 < phantom.contacts()) {
        EXPECT_EQ(contact.force.lateral_gap_m, 0.0);
      }
      const Eigen::Vector2d f = force(contact.force);
      wrench += Eigen::Vector3d(f(0), f(1), from_base(0) * f(1) - from_base(1) * f(0));
    }
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(phantom.base_wrench()[k], wrench(static_cast<Eigen::Index>(k)), 3e-6);

    const Eigen::Vector2d tip = deformed(phantom.tip_material_m());
    EXPECT_NEAR(tip(0), base(0) + c * needle_m, 1e-9);
    EXPECT_NEAR(tip(1), base(1) + s * needle_m, 1e-9);
  }
}

// Stuck all along, the needle is a rigid inclusion: its stiffness must not depend much on the mesh. (Point contacts one
// element apart follow the mesh; the remaining change is the end effect at the tip.)
TEST(PhantomBalance, StuckStiffnessSettlesUnderRefinement) {
  std::vector<double> stiffness;
  for (const int nodes : {11, 21, 31}) {
    PhantomConfig config = scene();
    config.tissue.grid = square(nodes);
    config.contact = {1e-6, 1e-6, 0.0, {}};
    Hand hand(config);
    hand.move(0.0, 0.005 + 0.0499, 0.0, 1e-3);
    const double before = hand.phantom.base_wrench()[0];
    hand.move(0.0005, 0.0);
    stiffness.push_back((hand.phantom.base_wrench()[0] - before) / 0.0005);
  }
  EXPECT_GT(stiffness[0], 10.0);
  EXPECT_LT(std::abs(stiffness[2] - stiffness[1]), std::abs(stiffness[1] - stiffness[0]));
  EXPECT_NEAR(stiffness[2] / stiffness[1], 1.0, 0.15);
}

}  // namespace
}  // namespace trocar::sim_plant
