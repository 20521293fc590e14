#include "host/tracking/grid.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "scenes.hpp"

namespace trocar::tracking {
namespace {

using testing::Film;

std::size_t right_ones(const DetectedGrid& grid, const Film& film, double within_px) {
  std::size_t n = 0;
  for (std::size_t k = 0; k < grid.place.size(); ++k)
    if (std::hypot(grid.place[k].u_px - film.truth()[k].pixel.u_px, grid.place[k].v_px - film.truth()[k].pixel.v_px) < within_px) ++n;
  return n;
}

TEST(Grid, IsFoundInCleanAndHardFramesWithItsOrientation) {
  for (const auto& appearance : {optics::clean_appearance(), optics::hard_appearance()}) {
    for (const auto kind : {optics::MotionKind::Still, optics::MotionKind::Shear, optics::MotionKind::Insertion}) {
      Film film = testing::small_film(kind, appearance);
      const auto& frame = film.frame(30);
      const DetectedGrid grid = detect_grid(frame, white_balance(frame), film.grid());
      EXPECT_EQ(grid.problem, "");
      EXPECT_GE(grid.seen, film.grid().markers() - 5);
      EXPECT_GE(right_ones(grid, film, 2.0), film.grid().markers() - 5);
      EXPECT_NEAR(grid.radius_px, 7.6, 0.6);
    }
  }
}

TEST(Grid, DotsMayBeMissingAndDirtBeThere) {
  Film film = testing::small_film(optics::MotionKind::Still);
  (void)film.frame(0);
  for (const std::size_t k : {0u, 10u, 11u, 30u, 62u}) film.cover(film.truth()[k].pixel.u_px, film.truth()[k].pixel.v_px, 11.0, 202);
  film.cover(20, 20, 8.0, 30);  // off the grid
  film.cover(660, 300, 7.0, 30);
  film.cover(300, 500, 3.0, 30);
  DetectedGrid grid = detect_grid(film.last(), white_balance(film.last()), film.grid());
  ASSERT_EQ(grid.problem, "");
  EXPECT_EQ(grid.seen, 58u);
  EXPECT_EQ(right_ones(grid, film, 1.0), 58u);
  EXPECT_TRUE(std::isnan(grid.place[0].u_px));
  fill_missing(grid.place, film.grid());
  EXPECT_EQ(right_ones(grid, film, 4.0), 63u);  // extrapolated, within half a dot
}

TEST(Grid, AnotherSizeIsSaid) {
  Film film = testing::small_film(optics::MotionKind::Still);
  const auto& frame = film.frame(0);
  optics::MarkerGrid other = film.grid();
  other.rows = 8;
  const DetectedGrid larger = detect_grid(frame, white_balance(frame), other);
  EXPECT_NE(larger.problem.find("a grid of 7 rows and 9 columns with 63 dots was found, not of 8 and 9"), std::string::npos)
      << larger.problem;
  EXPECT_TRUE(larger.place.empty());
  other.rows = 6;
  const DetectedGrid smaller = detect_grid(frame, white_balance(frame), other);
  EXPECT_NE(smaller.problem.find("fit in several places"), std::string::npos) << smaller.problem;
}

TEST(Grid, NothingIsFoundWhereNothingIs) {
  optics::Frame frame{0, 0, 400, 300, optics::PixelFormat::Mono8, std::vector<std::uint8_t>(400 * 300, 0)};
  EXPECT_NE(detect_grid(frame, white_balance(frame), {}).problem.find("0 dark dots were found, the grid has 441"), std::string::npos);
}

TEST(Grid, MissingPlacesFollowTheirNeighbours) {
  const optics::MarkerGrid grid{4, 4, 1.0, 0.1};
  std::vector<Place> places;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) places.push_back({10.0 * column + row, -12.0 * row + 2.0 * column});
  const std::vector<Place> all = places;
  for (const std::size_t k : {0u, 5u, 6u, 15u}) places[k] = {std::nan(""), std::nan("")};
  fill_missing(places, grid);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_NEAR(places[k].u_px, all[k].u_px, 1e-12);
    EXPECT_NEAR(places[k].v_px, all[k].v_px, 1e-12);
  }
  std::vector<Place> none(16, {std::nan(""), std::nan("")});
  fill_missing(none, grid);  // ends
  EXPECT_TRUE(std::isnan(none[3].u_px));
}

}  // namespace
}  // namespace trocar::tracking
