// Our lens model against OpenCV's, which is written by others.
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <random>

#include "common/optics/lens.hpp"

namespace trocar::optics {
namespace {

void compare(const Lens& lens, double width, double height) {
  const cv::Matx33d matrix(lens.fx_px, 0, lens.cx_px, 0, lens.fy_px, lens.cy_px, 0, 0, 1);
  const std::vector<double> terms(lens.distortion.begin(), lens.distortion.end());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(0.0, width), v(0.0, height);
  std::vector<cv::Point2d> seen;
  for (int k = 0; k < 500; ++k) seen.emplace_back(u(random), v(random));
  std::vector<cv::Point2d> theirs;
  cv::undistortPoints(seen, theirs, matrix, terms, cv::noArray(), matrix, {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 200, 1e-12});
  const Rectifier rectifier(lens);
  for (std::size_t k = 0; k < seen.size(); ++k) {
    for (const Mapped& ours : {rectifier.newton({seen[k].x, seen[k].y}), rectifier.fixed_point({seen[k].x, seen[k].y})}) {
      ASSERT_EQ(ours.status, Status::Ok);
      EXPECT_NEAR(ours.pixel.u_px, theirs[k].x, 1e-6);
      EXPECT_NEAR(ours.pixel.v_px, theirs[k].y, 1e-6);
    }
    const Ray ray = to_ray(lens, {theirs[k].x, theirs[k].y});
    std::vector<cv::Point2d> projected;
    cv::projectPoints(std::vector<cv::Point3d>{{ray.x, ray.y, 1.0}}, cv::Vec3d(), cv::Vec3d(), matrix, terms, projected);
    const Mapped back = rectifier.distort({theirs[k].x, theirs[k].y});
    EXPECT_NEAR(back.pixel.u_px, projected[0].x, 1e-9);
    EXPECT_NEAR(back.pixel.v_px, projected[0].y, 1e-9);
  }
}

TEST(LensAgainstOpenCv, SamePixelsForTheThesis) {
  compare({1884.0, 1884.0, 1044.0, 737.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}}, 2055, 1543);
}
TEST(LensAgainstOpenCv, SamePixelsForTheCalibratedCamera) {
  compare({535.916, 535.8, 342.283, 235.571, {-0.266373, -0.0385889, 0.00178319, -0.000281221, 0.238392}}, 639, 479);
}

}  // namespace
}  // namespace trocar::optics
