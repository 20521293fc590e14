#include "host/tracking/tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host/tracking/metric.hpp"
#include "host/tracking/plane_pose.hpp"
#include "scenes.hpp"

namespace trocar::tracking {
namespace {

using testing::Errors;
using testing::Film;

Tracker tracker_for(const Film& film, Method method = Method::Edge) {
  TrackerOptions options;
  options.grid = film.grid();
  options.method = method;
  return Tracker(options);
}

// The figures of the whole: full image, 441 markers, the thesis's lens, 200 frames in which markers move by 5 mm, a whole step of the grid.
struct Whole {
  Errors pixels{};
  double rms_m{};
};
Whole track_the_whole(const optics::Appearance& appearance, optics::MotionKind kind, int frames, int every) {
  const optics::Camera camera = testing::thesis_camera();
  Film film(camera, {}, appearance, {kind, 0.005, 0.009}, optics::thesis_m_per_px);
  Tracker tracker = tracker_for(film);
  Whole whole;
  EXPECT_EQ(tracker.start(film.frame(0)), "");
  const auto pose = fit_plane(camera.lens, film.grid(), tracker.markers());
  EXPECT_TRUE(pose);
  const optics::PlaneView view(camera.lens, pose->pose);
  double squares = 0.0;
  std::size_t n = 0;
  for (int k = every; k < frames * every; k += every) {
    auto frame = film.frame(k);
    frame.number = static_cast<std::uint64_t>(k / every);
    tracker.update(frame);
    testing::add(whole.pixels, tracker.markers(), film.truth(), 11.0);
    for (std::size_t i = 0; i < film.truth().size(); ++i) {
      const MetricMarker m = to_plane(view, tracker.markers()[i]);
      if (std::isnan(m.x_m)) continue;
      squares += std::pow(m.x_m - film.truth()[i].at.x_m, 2) + std::pow(m.y_m - film.truth()[i].at.y_m, 2);
      ++n;
    }
  }
  whole.rms_m = std::sqrt(squares / static_cast<double>(n));
  return whole;
}

TEST(Tracker, CleanFramesOfTheWholePhantomToATwentiethOfAPixel) {
  optics::Appearance appearance = optics::clean_appearance();
  appearance.read_noise = 1.2;  // grey levels: a good sensor's
  appearance.shot_noise = 0.03;
  const Whole whole = track_the_whole(appearance, optics::MotionKind::Shear, 60, 2);
  EXPECT_LT(whole.pixels.rms_px, 0.05);
  EXPECT_EQ(whole.pixels.lost, 0u);
  EXPECT_EQ(whole.pixels.wrong, 0u);
  EXPECT_LT(whole.rms_m, 1e-5);
}

TEST(Tracker, HardFramesOfTheWholePhantomOverTwoHundredFrames) {
  const Whole whole = track_the_whole(optics::hard_appearance(), optics::MotionKind::Insertion, 200, 1);
  EXPECT_LT(whole.pixels.rms_px, 0.15);
  EXPECT_EQ(whole.pixels.wrong, 0u);
  EXPECT_LT(whole.pixels.lost, 441u * 200u / 1000u);
  EXPECT_LT(whole.rms_m, 1e-5);
}

TEST(Tracker, TheThesissMethodFollowsAsWell) {
  Film film = testing::small_film(optics::MotionKind::Insertion, optics::hard_appearance());
  Tracker tracker = tracker_for(film, Method::Correlation);
  ASSERT_EQ(tracker.start(film.frame(0)), "");
  Errors e;
  for (int k = 1; k < 60; ++k) {
    tracker.update(film.frame(k));
    testing::add(e, tracker.markers(), film.truth(), 5.0);
  }
  EXPECT_EQ(e.wrong, 0u);
  EXPECT_LT(e.lost, 60u);
  EXPECT_LT(e.rms_px, 0.3);
}

TEST(Tracker, CoveredMarkersAreFlaggedAndComeBackAsThemselves) {
  for (const int level : {202, 30, 255}) {
    Film film = testing::small_film(optics::MotionKind::Shear);
    Tracker tracker = tracker_for(film);
    ASSERT_EQ(tracker.start(film.frame(0)), "");
    Errors e;
    std::size_t flagged = 0;
    for (int k = 1; k < 60; ++k) {
      auto& frame = const_cast<optics::Frame&>(film.frame(k));
      const bool covered = k >= 10 && k < 45;  // meanwhile everything moves by more than half a step
      if (covered) film.cover(343, 257, 75, static_cast<std::uint8_t>(level));
      tracker.update(frame);
      testing::add(e, tracker.markers(), film.truth(), 4.0);
      for (std::size_t i = 0; i < film.truth().size(); ++i) {
        const auto& p = film.truth()[i].pixel;
        if (covered && std::hypot(p.u_px - 343, p.v_px - 257) < 75 - 8) {
          EXPECT_FALSE(tracker.markers()[i].valid) << "frame " << k << " marker " << i << " level " << level;
          EXPECT_TRUE(std::isnan(tracker.markers()[i].u_px));
          ++flagged;
        }
      }
    }
    EXPECT_GT(flagged, 100u);
    EXPECT_EQ(e.wrong, 0u) << level;
    EXPECT_EQ(tracker.valid(), film.grid().markers()) << level;
  }
}

TEST(Tracker, ABlockThatSpringsBackIsNotTakenForItsNeighbours) {
  // Dragged by up to a step and a half of the grid, then back within one frame, as when the needle leaves the tissue.
  Film film(testing::small_camera(), testing::small_grid(), optics::clean_appearance(), {optics::MotionKind::Insertion, 0.012, 0.02},
            2.37e-4);
  Tracker tracker = tracker_for(film);
  ASSERT_EQ(tracker.start(film.frame(0)), "");
  Errors e;
  for (int k = 1; k <= 60; ++k) {
    tracker.update(film.frame(k));
    testing::add(e, tracker.markers(), film.truth(), 4.0);
  }
  double most = 0.0;
  const std::vector<optics::MarkerTruth> dragged(film.truth().begin(), film.truth().end());
  for (int k = 61; k < 70; ++k) {
    optics::Frame frame = film.frame(0);
    frame.number = static_cast<std::uint64_t>(k);
    for (std::size_t i = 0; i < dragged.size(); ++i)
      most = std::max(most,
                      std::hypot(dragged[i].pixel.u_px - film.truth()[i].pixel.u_px, dragged[i].pixel.v_px - film.truth()[i].pixel.v_px));
    tracker.update(frame);
    testing::add(e, tracker.markers(), film.truth(), 4.0);
  }
  EXPECT_GT(most, 20.0);  // more than half of the 34 px from dot to dot
  EXPECT_EQ(e.wrong, 0u);
  EXPECT_GE(tracker.valid(), film.grid().markers() - 2);
}

TEST(Tracker, FramesMayBeMissing) {
  Film film = testing::small_film(optics::MotionKind::Shear);
  Tracker tracker = tracker_for(film);
  ASSERT_EQ(tracker.start(film.frame(0)), "");
  Errors e;
  for (const int k : {1, 2, 3, 6, 7, 12, 13, 14, 22, 23, 24, 60, 61, 99}) {  // the last ones after more than half a step
    tracker.update(film.frame(k));
    testing::add(e, tracker.markers(), film.truth(), 4.0);
  }
  EXPECT_EQ(e.wrong, 0u);
  EXPECT_EQ(tracker.valid(), film.grid().markers());
}

TEST(Tracker, InDarknessAllAreLostAndAfterwardsFound) {
  Film film = testing::small_film(optics::MotionKind::Shear);
  Tracker tracker = tracker_for(film);
  ASSERT_EQ(tracker.start(film.frame(0)), "");
  optics::Frame black = film.frame(1);
  std::ranges::fill(black.pixels, std::uint8_t{0});
  for (std::uint64_t k = 1; k < 10; ++k) {
    black.number = k;
    tracker.update(black);
    EXPECT_EQ(tracker.valid(), 0u);
  }
  tracker.update(film.frame(40));  // a step of the grid later
  EXPECT_EQ(tracker.valid(), film.grid().markers());
  Errors e;
  testing::add(e, tracker.markers(), film.truth(), 4.0);
  EXPECT_EQ(e.wrong, 0u);
}

TEST(Tracker, StartsFromGivenPlacesAndSaysWhenNothingIsThere) {
  Film film = testing::small_film(optics::MotionKind::Still);
  const auto& frame = film.frame(0);
  std::vector<Place> places;
  for (const auto& t : film.truth()) places.push_back({t.pixel.u_px + 3.0, t.pixel.v_px - 3.0});
  Tracker tracker = tracker_for(film);
  EXPECT_EQ(tracker.start(frame, places, 7.6), "");
  EXPECT_EQ(tracker.valid(), film.grid().markers());
  optics::Frame black = frame;
  std::ranges::fill(black.pixels, std::uint8_t{0});
  EXPECT_NE(tracker.start(black, places, 7.6).find("0 of 63 markers were found"), std::string::npos);
  EXPECT_NE(tracker.start(black), "");
}

TEST(Tracker, ThreadsChangeNothing) {
  Film film = testing::small_film(optics::MotionKind::Insertion, optics::hard_appearance());
  TrackerOptions options;
  options.grid = film.grid();
  options.threads = 1;
  Tracker one(options);
  options.threads = 3;
  Tracker three(options);
  ASSERT_EQ(one.start(film.frame(0)), "");
  ASSERT_EQ(three.start(film.last()), "");
  for (int k = 1; k < 10; ++k) {
    one.update(film.frame(k));
    three.update(film.last());
    for (std::size_t i = 0; i < film.grid().markers(); ++i) {
      ASSERT_EQ(one.markers()[i].valid, three.markers()[i].valid);
      if (one.markers()[i].valid) {
        EXPECT_EQ(one.markers()[i].u_px, three.markers()[i].u_px);
      }
    }
  }
}

}  // namespace
}  // namespace trocar::tracking
