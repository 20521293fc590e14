// A program of its own, because it replaces the allocator: no kernel allocates.
#include <gtest/gtest.h>

#include "common/element/element.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::element {
namespace {

using reference::allocations;

TEST(ElementNoAllocation, InAnyKernel) {
  Corners quad = Corners::Zero();
  quad.topLeftCorner<2, 4>() << 0, 1, 1.1, -0.1, 0, 0.1, 1, 0.9;
  Corners brick = Corners::Zero();
  brick << 0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1;
  Corners tet = Corners::Zero();
  tet(0, 1) = tet(1, 2) = tet(2, 3) = 1.0;
  Stiffness k;
  Values u = Values::Constant(0.01), force;
  Shape value;
  ShapeGradient gradient;
  Eigen::Vector3d natural;

  const std::size_t at_start = allocations();
  void* volatile counted = ::operator new(1);
  ::operator delete(counted);
  ASSERT_GT(allocations(), at_start);  // the counter works
  const std::size_t before = allocations();
  bool good = true;
  for (const Integration integration : {Integration::Full, Integration::BBar}) {
    for (const Model model : {Model::PlaneStress, Model::PlaneStrain, Model::Solid}) {
      const Elasticity c = elasticity(model, {25300.0, 0.48});
      for (const Type type : {Type::Tri3, Type::Quad4, Type::Tet4, Type::Hex8}) {
        if ((dimension(type) == 3) != (model == Model::Solid)) continue;
        const Corners& corner = type == Type::Hex8 ? brick : type == Type::Tet4 ? tet : quad;
        good = good && stiffness(type, integration, corner, c, 0.011, k) == Status::Ok;
        good = good && response(type, integration, corner, c, 0.011, u, force, k) == Status::Ok;
        good = good && natural_coordinates(type, corner, {0.6, 0.3, 0.05}, natural) && inside(type, natural, 0.0);
        shape(type, natural, value, gradient);
      }
    }
  }
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_TRUE(good);
}

}  // namespace
}  // namespace trocar::element
