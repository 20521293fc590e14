#include "cases.hpp"

namespace trocar::element {
namespace {

class EachShape : public testing::TestWithParam<Type> {};
INSTANTIATE_TEST_SUITE_P(Element, EachShape, testing::Values(Type::Tri3, Type::Quad4, Type::Tet4, Type::Hex8),
                         [](const auto& parameter) { return type_name(parameter.param); });

// A point of the element, drawn at random.
Eigen::Vector3d inner_point(Type type, Random& random) {
  for (;;) {
    Eigen::Vector3d p(random(-1, 1), random(-1, 1), dimension(type) == 3 ? random(-1, 1) : 0.0);
    if (simplex(type)) p = p.cwiseAbs();
    if (inside(type, p, 0.0)) return p;
  }
}

TEST_P(EachShape, IsOneAtItsNodeAndSumsToOne) {
  const Type type = GetParam();
  Random random(1);
  Shape value;
  ShapeGradient gradient;
  for (int k = 0; k < node_count(type); ++k) {
    shape(type, reference(type).col(k), value, gradient);
    for (int j = 0; j < 8; ++j) EXPECT_EQ(value(j), j == k ? 1.0 : 0.0);
  }
  for (int trial = 0; trial < 20; ++trial) {
    shape(type, inner_point(type, random), value, gradient);
    EXPECT_NEAR(value.sum(), 1.0, 1e-15);
    EXPECT_GE(value.minCoeff(), 0.0);
    EXPECT_LT(gradient.rowwise().sum().cwiseAbs().maxCoeff(), 1e-15);
  }
}

TEST_P(EachShape, GradientIsTheDerivativeOfTheValue) {
  const Type type = GetParam();
  Random random(2);
  const Eigen::Vector3d at = inner_point(type, random);
  Shape value, plus, minus;
  ShapeGradient gradient, ignored;
  shape(type, at, value, gradient);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = 1e-3 * Eigen::Vector3d::Unit(axis);  // shape functions are linear along each axis: no truncation error
    shape(type, at + step, plus, ignored);
    shape(type, at - step, minus, ignored);
    EXPECT_LT((gradient.row(axis).transpose() - (plus - minus) / 2e-3).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST_P(EachShape, FindsTheNaturalCoordinatesOfAPoint) {
  const Type type = GetParam();
  Random random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const Corners corner = distorted(type, random, 0.25);
    const Eigen::Vector3d expected = inner_point(type, random);
    Shape value;
    ShapeGradient gradient;
    shape(type, expected, value, gradient);
    Eigen::Vector3d natural;
    ASSERT_TRUE(natural_coordinates(type, corner, corner * value, natural));
    EXPECT_LT((natural - expected).cwiseAbs().maxCoeff(), 1e-11);
    EXPECT_TRUE(inside(type, natural, 1e-9));
  }
}

TEST_P(EachShape, KeepsItsDigitsFarFromTheOrigin) {
  const Type type = GetParam();
  Random random(4);
  Corners corner = distorted(type, random, 0.2, 1e-5);
  corner.row(1).array() += 0.28;
  const Eigen::Vector3d expected = inner_point(type, random);
  Shape value;
  ShapeGradient gradient;
  shape(type, expected, value, gradient);
  Eigen::Vector3d natural;
  ASSERT_TRUE(natural_coordinates(type, corner, corner * value, natural));
  EXPECT_LT((natural - expected).cwiseAbs().maxCoeff(), 1e-10);
}

TEST_P(EachShape, AnswersForPointsOutside) {
  const Type type = GetParam();
  Random random(5);
  const Corners corner = distorted(type, random, 0.0);
  for (int k = 0; k < node_count(type); ++k) {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (int j = 0; j < node_count(type); ++j) centre += corner.col(j) / node_count(type);
    const Eigen::Vector3d x = corner.col(k) + 2.0 * (corner.col(k) - centre);
    Eigen::Vector3d natural;
    ASSERT_TRUE(natural_coordinates(type, corner, x, natural));
    EXPECT_FALSE(inside(type, natural, 0.1));
    Shape value;
    ShapeGradient gradient;
    shape(type, natural, value, gradient);
    EXPECT_LT((corner * value - x).norm(), 1e-14);
  }
}

TEST_P(EachShape, IgnoresTheThirdCoordinateInThePlane) {
  const Type type = GetParam();
  if (dimension(type) == 3) return;
  Random random(6);
  const Corners corner = distorted(type, random, 0.2);
  Eigen::Vector3d a, b;
  ASSERT_TRUE(natural_coordinates(type, corner, {0.03, -0.02, 0.0}, a));
  ASSERT_TRUE(natural_coordinates(type, corner, {0.03, -0.02, 5.0}, b));
  EXPECT_EQ(a, b);
  EXPECT_EQ(a(2), 0.0);
}

TEST_P(EachShape, RefusesAFlatElementAndNotANumber) {
  const Type type = GetParam();
  Random random(7);
  Corners corner = distorted(type, random, 0.1);
  Eigen::Vector3d natural;
  EXPECT_FALSE(natural_coordinates(type, corner, {std::nan(""), 0.0, 0.0}, natural));
  corner.row(1).setZero();
  EXPECT_FALSE(natural_coordinates(type, corner, {0.03, 0.01, 0.0}, natural));
}

TEST_P(EachShape, InsideHoldsItsBoundaryAndTheTolerance) {
  const Type type = GetParam();
  for (int k = 0; k < node_count(type); ++k) {
    const Eigen::Vector3d corner = reference(type).col(k);
    EXPECT_TRUE(inside(type, corner, 0.0));
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (int axis = 0; simplex(type) && axis < dimension(type); ++axis) centre(axis) = 1.0 / node_count(type);
    const Eigen::Vector3d beyond = corner + 0.01 * (corner - centre);
    EXPECT_FALSE(inside(type, beyond, 0.001));
    EXPECT_TRUE(inside(type, beyond, 0.02));
  }
}

// Outside of a strongly tapered quad the bilinear map has points without an image.
TEST(Shape, SaysWhenNoNaturalCoordinatesExist) {
  Corners corner = Corners::Zero();
  corner.topLeftCorner<2, 4>() << -1, 1, 0.2, -0.2, 0, 0, 1, 1;
  Eigen::Vector3d natural;
  EXPECT_TRUE(natural_coordinates(Type::Quad4, corner, {0.0, 0.9, 0.0}, natural));
  EXPECT_FALSE(natural_coordinates(Type::Quad4, corner, {0.5, 1.25, 0.0}, natural));  // eta where the sides meet
}

}  // namespace
}  // namespace trocar::element
