#include <gtest/gtest.h>

#include "scene.hpp"

namespace trocar::tracking {
namespace {

struct Seen {
  optics::Frame frame{};
  std::vector<optics::MarkerTruth> truth{};
};

Seen render(const optics::Pose& pose, const optics::Appearance& appearance, const optics::MarkerGrid& grid = small_grid()) {
  optics::Renderer renderer(small_camera(), pose, grid, appearance, 4);
  Seen seen;
  const optics::SyntheticMotion still{};
  renderer.render(still.markers(grid, 0.0), {}, 0, 0, seen.frame);
  seen.truth.assign(renderer.truth().begin(), renderer.truth().end());
  return seen;
}

// A disc of one level, to hide a dot or to make a false one.
void blot(optics::Frame& frame, double u_px, double v_px, double radius_px, std::uint8_t level) {
  for (int v = 0; v < frame.height_px; ++v)
    for (int u = 0; u < frame.width_px; ++u)
      if (std::hypot(u - u_px, v - v_px) < radius_px)
        frame.pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width_px) + static_cast<std::size_t>(u)] = level;
}

void expect_all(const DetectedGrid& found, const Seen& seen, std::size_t missing = 0) {
  ASSERT_EQ(found.problem, "");
  EXPECT_EQ(found.seen, seen.truth.size() - missing);
  for (std::size_t k = 0; k < seen.truth.size(); ++k) {
    if (std::isnan(found.place[k].u_px)) continue;
    EXPECT_LT(std::hypot(found.place[k].u_px - seen.truth[k].pixel.u_px, found.place[k].v_px - seen.truth[k].pixel.v_px), 5.0) << k;
  }
}

TEST(DetectGrid, FindsTheMarkersInTheirOrder) {
  const Seen clean = render(small_pose(), optics::clean_appearance());
  expect_all(detect_grid(clean.frame, white_balance(clean.frame), small_grid()), clean);
  // Column 0 on the left, row 0 at the bottom.
  EXPECT_LT(clean.truth[0].pixel.u_px, clean.truth[8].pixel.u_px);
  EXPECT_GT(clean.truth[0].pixel.v_px, clean.truth[72].pixel.v_px);
}

TEST(DetectGrid, FindsThemInAHardImageFromASlant) {
  const Seen hard = render(small_pose(0.12), optics::hard_appearance());
  expect_all(detect_grid(hard.frame, white_balance(hard.frame), small_grid()), hard);
}

TEST(DetectGrid, BearsMissingDotsAndFalseOnes) {
  Seen seen = render(small_pose(), optics::clean_appearance());
  for (const std::size_t k : {0U, 13U, 14U, 40U, 44U, 79U}) blot(seen.frame, seen.truth[k].pixel.u_px, seen.truth[k].pixel.v_px, 20.0, 200);
  for (const std::size_t k : {3U, 22U, 50U})  // between the dots
    blot(seen.frame, seen.truth[k].pixel.u_px + 31.0, seen.truth[k].pixel.v_px - 29.0, 9.0, 40);
  blot(seen.frame, 20.0, 20.0, 10.0, 40);
  const DetectedGrid found = detect_grid(seen.frame, white_balance(seen.frame), small_grid());
  expect_all(found, seen, 6);
  EXPECT_TRUE(std::isnan(found.place[40].u_px));
}

TEST(DetectGrid, SaysWhatItFoundInsteadOfTheGridAskedFor) {
  const Seen seen = render(small_pose(), optics::clean_appearance());
  for (const optics::MarkerGrid asked : {optics::MarkerGrid{10, 9}, optics::MarkerGrid{8, 9}, optics::MarkerGrid{21, 21}}) {
    const DetectedGrid found = detect_grid(seen.frame, white_balance(seen.frame), asked);
    EXPECT_NE(found.problem.find("9 rows and 9 columns"), std::string::npos) << asked.rows << ": " << found.problem;
    EXPECT_NE(found.problem.find("--rows"), std::string::npos) << found.problem;
    EXPECT_TRUE(found.place.empty());
  }
}

TEST(DetectGrid, SaysThatABlackImageHoldsNoDots) {
  optics::Frame frame{0, 0, 640, 640, optics::PixelFormat::Mono8, std::vector<std::uint8_t>(std::size_t{640} * 640)};
  const DetectedGrid found = detect_grid(frame, white_balance(frame), small_grid());
  EXPECT_NE(found.problem.find("0 dark dots"), std::string::npos) << found.problem;
}

TEST(DetectGrid, SeesThroughABayerPattern) {
  optics::Appearance appearance = optics::hard_appearance();
  appearance.format = optics::PixelFormat::BayerRG8;
  const Seen hard = render(small_pose(), appearance);
  expect_all(detect_grid(hard.frame, white_balance(hard.frame), small_grid()), hard);
}

TEST(FillMissing, GoesOnAlongARowThatBends) {
  const optics::MarkerGrid grid{1, 5};
  std::vector<Place> place{{0.0, 0.0}, {10.0, 1.0}, {std::nan(""), std::nan("")}, {30.0, 3.0}, {std::nan(""), std::nan("")}};
  fill_missing(place, grid);
  EXPECT_NEAR(place[2].u_px, 20.0, 1e-9);
  EXPECT_NEAR(place[4].v_px, 4.0, 1e-9);
}

}  // namespace
}  // namespace trocar::tracking
