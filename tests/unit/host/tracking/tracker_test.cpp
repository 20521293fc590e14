#include <gtest/gtest.h>

#include <functional>

#include "scene.hpp"

namespace trocar::tracking {
namespace {

using Spoil = std::function<void(int frame, std::span<const optics::MarkerTruth>, optics::Frame&)>;

struct Course {
  optics::Appearance appearance{};
  optics::MotionKind motion{optics::MotionKind::Shear};
  int frames{200};
  int skip_from{-1}, skip_to{-1};  // lost on the way
  Spoil spoil{};
};
struct Outcome {
  double rms_px{}, worst_px{};
  std::size_t wrong{};  // markers further off than half a dot: on another one, or on nothing
  std::vector<std::size_t> valid{};
  double furthest_px{};  // that a marker went
};

Outcome run(Tracker& tracker, const Course& course, const std::function<void(int)>& look = {}) {
  const optics::MarkerGrid grid = small_grid();
  optics::Renderer renderer(small_camera(), small_pose(), grid, course.appearance, 7);
  const optics::SyntheticMotion motion{course.motion};
  optics::Frame frame;
  Outcome out;
  double squares = 0.0;
  std::size_t n = 0;
  std::vector<optics::MarkerTruth> first;
  for (int k = 0; k < course.frames; ++k) {
    if (k >= course.skip_from && k < course.skip_to) continue;
    const double t_s = k / 30.0;
    renderer.render(motion.markers(grid, t_s), motion.needle(grid, t_s), static_cast<std::uint64_t>(k), 0, frame);
    const auto truth = renderer.truth();
    if (course.spoil) course.spoil(k, truth, frame);
    if (k == 0) {
      EXPECT_EQ(tracker.start(frame), "");
      first.assign(truth.begin(), truth.end());
    } else {
      tracker.update(frame);
    }
    out.valid.push_back(tracker.valid());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      out.furthest_px = std::max(out.furthest_px, std::hypot(truth[i].pixel.u_px - first[i].pixel.u_px,  //
                                                             truth[i].pixel.v_px - first[i].pixel.v_px));
      const Marker& m = tracker.markers()[i];
      if (!m.valid) {
        EXPECT_TRUE(std::isnan(m.u_px) && std::isnan(m.v_px));
        continue;
      }
      const double e = distance_px(m, truth[i]);
      out.wrong += e > 5.0 ? 1 : 0;
      out.worst_px = std::max(out.worst_px, e);
      squares += e * e;
      ++n;
    }
    if (look) look(k);
  }
  out.rms_px = std::sqrt(squares / static_cast<double>(n));
  return out;
}

// A patch of bare slab over a place, as wide as a dot and its surroundings.
void cover(optics::Frame& frame, const optics::Pixel& at, double radius_px) {
  for (int v = 0; v < frame.height_px; ++v)
    for (int u = 0; u < frame.width_px; ++u)
      if (std::hypot(u - at.u_px, v - at.v_px) < radius_px)
        frame.pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width_px) + static_cast<std::size_t>(u)] =
            static_cast<std::uint8_t>(190 + (u * 7 + v * 3) % 5);
}

class EachMethod : public ::testing::TestWithParam<Method> {
 protected:
  [[nodiscard]] static TrackerOptions options() { return {small_grid(), GetParam(), 2, 41}; }
};

TEST_P(EachMethod, KeepsMarkersApartWhileTheyMoveByAStepOfTheGrid) {
  Tracker tracker(options());
  const Outcome out = run(tracker, {optics::hard_appearance()});
  EXPECT_GT(out.furthest_px, 55.0);  // of 62 from marker to marker
  EXPECT_EQ(out.wrong, 0U);
  EXPECT_EQ(std::ranges::min(out.valid), 81U);
  EXPECT_LT(out.rms_px, GetParam() == Method::Edge ? 0.08 : 0.4);
}

TEST_P(EachMethod, IsExactInAClearImage) {
  Tracker tracker(options());
  Course course{optics::clean_appearance()};
  course.frames = 20;
  const Outcome out = run(tracker, course);
  EXPECT_LT(out.rms_px, GetParam() == Method::Edge ? 0.04 : 0.15);
}

TEST_P(EachMethod, LosesWhatIsCoveredAndFindsItAgain) {
  Tracker tracker(options());
  Course course{optics::hard_appearance()};
  course.frames = 120;
  const std::vector<std::size_t> covered{0, 30, 31, 39, 40, 41, 49, 50, 44, 80};
  course.spoil = [&](int k, std::span<const optics::MarkerTruth> truth, optics::Frame& frame) {
    if (k < 10 || k >= 90) return;
    for (const std::size_t i : covered) cover(frame, truth[i].pixel, 24.0);
  };
  const Outcome out = run(tracker, course, [&](int k) {
    for (const std::size_t i : covered) {
      EXPECT_EQ(tracker.markers()[i].valid, k < 10 || k >= 90) << "marker " << i << " frame " << k;
    }
  });
  EXPECT_EQ(out.wrong, 0U);
  EXPECT_EQ(out.valid[50], 81U - covered.size());
}

TEST_P(EachMethod, GoesOnAfterLostFramesInWhichMarkersWentFar) {
  Tracker tracker(options());
  Course course{optics::hard_appearance()};
  course.frames = 80;
  course.skip_from = 4;
  course.skip_to = 30;
  const Outcome out = run(tracker, course);
  EXPECT_EQ(out.wrong, 0U);
  EXPECT_EQ(out.valid.back(), 81U);
}

TEST_P(EachMethod, SeesNothingInDarkFramesAndEverythingAfter) {
  Tracker tracker(options());
  Course course{optics::hard_appearance()};
  course.frames = 40;
  course.spoil = [](int k, std::span<const optics::MarkerTruth>, optics::Frame& frame) {
    if (k >= 5 && k < 20) std::ranges::fill(frame.pixels, std::uint8_t{0});
  };
  const Outcome out = run(tracker, course);
  EXPECT_EQ(out.wrong, 0U);
  for (std::size_t k = 0; k < out.valid.size(); ++k) EXPECT_EQ(out.valid[k], k >= 5 && k < 20 ? 0U : 81U) << k;
}

INSTANTIATE_TEST_SUITE_P(Tracker, EachMethod, ::testing::Values(Method::Edge, Method::Correlation),
                         [](const auto& method) { return method.param == Method::Edge ? "Edge" : "Correlation"; });

TEST(Tracker, StartsFromPlacesThatAreOffByPartOfADot) {
  const optics::MarkerGrid grid = small_grid();
  optics::Renderer renderer(small_camera(), small_pose(), grid, optics::clean_appearance(), 7);
  optics::Frame frame;
  renderer.render(optics::SyntheticMotion{}.markers(grid, 0.0), {}, 0, 0, frame);
  std::vector<Place> places;
  for (const optics::MarkerTruth& t : renderer.truth()) places.push_back({t.pixel.u_px + 4.0, t.pixel.v_px - 3.0});
  places[40] = {std::nan(""), std::nan("")};
  Tracker tracker({grid});
  ASSERT_EQ(tracker.start(frame, places, 11.0), "");
  EXPECT_EQ(tracker.valid(), 81U);
  for (std::size_t k = 0; k < 81; ++k) EXPECT_LT(distance_px(tracker.markers()[k], renderer.truth()[k]), 0.1);
}

TEST(Tracker, AnswersTheSameWithOneThreadAsWithFour) {
  Tracker one({small_grid(), Method::Edge, 1, 41}), four({small_grid(), Method::Edge, 4, 41});
  Course course{optics::hard_appearance()};
  course.frames = 10;
  run(one, course);
  run(four, course);
  for (std::size_t k = 0; k < 81; ++k) {
    EXPECT_EQ(one.markers()[k].u_px, four.markers()[k].u_px);
    EXPECT_EQ(one.markers()[k].v_px, four.markers()[k].v_px);
  }
}

}  // namespace
}  // namespace trocar::tracking
