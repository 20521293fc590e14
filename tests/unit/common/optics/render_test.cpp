#include "common/optics/render.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/optics/synthetic_motion.hpp"

namespace trocar::optics {
namespace {

// A third of the thesis's image, and no distortion unless asked for.
Camera camera(double k1 = 0.0) { return {640, 480, {600.0, 600.0, 325.0, 235.0, {k1, 0.0, 0.0, 0.0, 0.0}}, {}}; }
MarkerGrid grid() { return {5, 5, 0.005, 0.0018}; }
constexpr double m_per_px = 1.0e-4;

struct Image {
  explicit Image(const Appearance& appearance, double k1 = 0.0, std::uint64_t seed = 1, double tilt = 0.0)
      : renderer(camera(k1), posed(tilt), grid(), appearance, seed) {}
  static Pose posed(double tilt) {
    Pose pose = looking_down(camera(), grid(), m_per_px);
    pose.rotation_rad[0] += tilt;
    return pose;
  }
  void render(const std::vector<MarkerState>& markers, const std::vector<PlanePoint>& needle = {}, std::uint64_t number = 0) {
    renderer.render(markers, needle, number, 0, frame);
  }
  [[nodiscard]] double level(int u, int v) const { return frame.pixels[static_cast<std::size_t>(v) * 640 + static_cast<std::size_t>(u)]; }
  Renderer renderer;
  Frame frame{};
};

std::vector<MarkerState> still() { return SyntheticMotion{}.markers(grid(), 0.0); }

struct Moments {
  double mass{}, u{}, v{}, uu{}, vv{};
};
// Of what is darker than the slab, about a place.
Moments moments_of(const Image& image, const Pixel& at, double slab, int reach = 20) {
  Moments m;
  const int u0 = static_cast<int>(std::lround(at.u_px)), v0 = static_cast<int>(std::lround(at.v_px));
  for (int pass = 0; pass < 2; ++pass) {
    for (int v = v0 - reach; v <= v0 + reach; ++v) {
      for (int u = u0 - reach; u <= u0 + reach; ++u) {
        const double w = slab - image.level(u, v);
        if (pass == 0) {
          m.mass += w;
          m.u += w * u;
          m.v += w * v;
        } else {
          m.uu += w * (u - m.u) * (u - m.u) / m.mass;
          m.vv += w * (v - m.v) * (v - m.v) / m.mass;
        }
      }
    }
    if (pass == 0) {
      m.u /= m.mass;
      m.v /= m.mass;
    }
  }
  return m;
}
constexpr double slab = 202.0;  // mean of the slab's colours

TEST(Render, ADotsCentroidIsItsCentre) {
  Image image(clean_appearance());
  image.render(still());
  ASSERT_EQ(image.frame.pixels.size(), 640u * 480u);
  for (const MarkerTruth& truth : image.renderer.truth()) {
    ASSERT_TRUE(truth.visible);
    const Moments m = moments_of(image, truth.pixel, slab);
    EXPECT_NEAR(m.u, truth.pixel.u_px, 0.01);  // of it 0.003 from rounding to grey levels
    EXPECT_NEAR(m.v, truth.pixel.v_px, 0.01);
    // A disc of radius r: its area, and a second moment of r^2 / 4 besides the blur's.
    const double r = 0.5 * 0.0018 / m_per_px;
    EXPECT_NEAR(m.mass / (0.86 * slab), std::numbers::pi * r * r, 0.01 * std::numbers::pi * r * r);
    EXPECT_NEAR(m.uu, r * r / 4.0 + 0.7 * 0.7 + 1.0 / 12.0, 0.3);
  }
}

TEST(Render, LensAndTiltMoveTheDotsAsTheCameraModelSays) {
  Image image(clean_appearance(), -0.25, 1, 0.2);
  image.render(still());
  const PlaneView view(camera(-0.25).lens, Image::posed(0.2));
  double farthest = 0.0;
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      const PlanePoint centre = grid().at_rest(row, column);
      const auto pixel = view.project(centre);
      ASSERT_TRUE(pixel);
      EXPECT_EQ(image.renderer.truth()[grid().index(row, column)].pixel.v_px, pixel->v_px);
      // The blob's centroid: of the disc's image, in which perspective draws the far half smaller.
      double area = 0.0, mean_u = 0.0, mean_v = 0.0;
      for (int i = -20; i <= 20; ++i) {
        for (int j = -20; j <= 20; ++j) {
          if (i * i + j * j > 400) continue;
          const PlanePoint p{centre.x_m + 0.0009 * i / 20.0, centre.y_m + 0.0009 * j / 20.0};
          const Jacobian2 d = view.jacobian(p);
          const double w = std::abs(d[0][0] * d[1][1] - d[0][1] * d[1][0]);
          area += w;
          mean_u += w * view.project(p)->u_px;
          mean_v += w * view.project(p)->v_px;
        }
      }
      const Moments m = moments_of(image, *pixel, slab, 16);
      EXPECT_NEAR(m.u, mean_u / area, 0.01);
      EXPECT_NEAR(m.v, mean_v / area, 0.01);
      farthest = std::max(farthest, std::abs(mean_v / area - pixel->v_px));
    }
  }
  EXPECT_GT(farthest, 0.02);  // so that the distinction is tested
}

TEST(Render, BlurIsAsLongAsTheWayWithinTheExposure) {
  Appearance appearance = clean_appearance();
  Image sharp(appearance);
  appearance.exposure_s = 0.1;
  Image blurred(appearance);
  auto markers = still();
  for (MarkerState& m : markers) m.vx_m_s = 0.006;  // 6 px in 0.1 s
  sharp.render(still());
  blurred.render(markers);
  for (std::size_t k = 0; k < 25; k += 6) {
    const Moments a = moments_of(sharp, sharp.renderer.truth()[k].pixel, slab),
                  b = moments_of(blurred, blurred.renderer.truth()[k].pixel, slab);
    EXPECT_NEAR(b.u, a.u, 0.01);  // the middle of the exposure
    EXPECT_NEAR(b.uu - a.uu, 36.0 / 12.0, 0.15);
    EXPECT_NEAR(b.vv - a.vv, 0.0, 0.05);
  }
}

TEST(Render, RowsAreExposedOneAfterTheOther) {
  Appearance appearance = clean_appearance();
  appearance.line_s = 1e-4;
  Image image(appearance);
  auto markers = still();
  for (MarkerState& m : markers) m.vx_m_s = 0.05;  // 500 px/s: 0.05 px a row
  image.render(markers);
  const PlaneView view(camera().lens, Image::posed(0.0));
  for (std::size_t k = 0; k < 25; k += 4) {
    const MarkerTruth& truth = image.renderer.truth()[k];
    const auto middle = view.project(markers[k].at);
    ASSERT_TRUE(middle);
    EXPECT_NEAR(truth.pixel.u_px - middle->u_px, 0.05 * (truth.pixel.v_px - 239.5), 0.01);
    const Moments m = moments_of(image, truth.pixel, slab);
    EXPECT_NEAR(m.u, truth.pixel.u_px, 0.02);
  }
}

TEST(Render, NoiseHasTheVarianceOfItsModel) {
  Appearance appearance = clean_appearance();
  appearance.read_noise = 2.0;
  appearance.shot_noise = 0.04;
  Image image(appearance);
  image.render(still());
  double mean = 0.0, square = 0.0;
  int n = 0;
  for (int v = 10; v < 470; ++v)
    for (int u = 5; u < 80; ++u, ++n) {  // left of the dots
      mean += image.level(u, v);
      square += image.level(u, v) * image.level(u, v);
    }
  mean /= n;
  const double variance = square / n - mean * mean;
  EXPECT_NEAR(mean, slab, 0.1);
  EXPECT_NEAR(variance, 4.0 + 0.04 * slab + 1.0 / 12.0, 0.4);  // and of rounding
  // Another frame has other noise, the same frame the same.
  Image again(appearance);
  again.render(still());
  EXPECT_EQ(again.frame.pixels, image.frame.pixels);
  again.render(still(), {}, 1);
  EXPECT_NE(again.frame.pixels, image.frame.pixels);
}

TEST(Render, ABayerPixelIsTheColourImagesChannel) {
  Appearance appearance = hard_appearance();
  appearance.read_noise = appearance.shot_noise = 0.0;
  appearance.format = PixelFormat::Rgb8;
  Image colour(appearance);
  appearance.format = PixelFormat::BayerRG8;
  Image bayer(appearance);
  colour.render(still());
  bayer.render(still());
  ASSERT_EQ(colour.frame.pixels.size(), 3 * bayer.frame.pixels.size());
  for (std::size_t v = 0; v < 480; v += 3)
    for (std::size_t u = 0; u < 640; u += 7) {
      const std::size_t channel = v % 2 == 0 ? (u % 2 == 0 ? 0u : 1u) : (u % 2 == 0 ? 1u : 2u);
      EXPECT_EQ(bayer.frame.pixels[v * 640 + u], colour.frame.pixels[3 * (v * 640 + u) + channel]);
    }
}

TEST(Render, HolesAreBrightWithinTheirDots) {
  Appearance appearance = clean_appearance();
  appearance.hole_part = 1.0;
  Image image(appearance);
  image.render(still());
  for (const MarkerTruth& truth : image.renderer.truth()) {
    double brightest = 0.0;
    const int r = static_cast<int>(0.8 * 0.5 * 0.0018 / m_per_px) - 1;
    for (int v = -r; v <= r; ++v)
      for (int u = -r; u <= r; ++u)
        if (u * u + v * v <= r * r)
          brightest = std::max(brightest, image.level(static_cast<int>(std::lround(truth.pixel.u_px)) + u,
                                                      static_cast<int>(std::lround(truth.pixel.v_px)) + v));
    EXPECT_GT(brightest, 150.0);  // a dot is at 28
  }
}

TEST(Render, TheNeedlesShadowLiesOnItsLine) {
  Appearance appearance = clean_appearance();
  appearance.shadow_depth = 0.4;
  Image image(appearance);
  // Between two columns, from below to the third row.
  const std::vector<PlanePoint> needle{{0.0075, -0.01}, {0.0075, 0.0125}};
  image.render(still(), needle);
  const PlaneView view(camera().lens, Image::posed(0.0));
  const auto on = view.project({0.0075, 0.0025}), beyond = view.project({0.0075, 0.0175}), beside = view.project({0.0025, 0.0025});
  ASSERT_TRUE(on && beyond && beside);
  const auto level = [&](const Pixel& p) {
    return image.level(static_cast<int>(std::lround(p.u_px)), static_cast<int>(std::lround(p.v_px)));
  };
  EXPECT_NEAR(level(*on), 0.6 * slab, 5.0);
  EXPECT_NEAR(level(*beyond), slab, 1.0);
  EXPECT_NEAR(level(*beside), slab, 1.0);
}

TEST(Render, SeedsDifferAndMistakesAreRefused) {
  Image one(hard_appearance(), 0.0, 1), other(hard_appearance(), 0.0, 2);
  one.render(still());
  other.render(still());
  EXPECT_NE(one.frame.pixels, other.frame.pixels);
  EXPECT_THROW(one.render(std::vector<MarkerState>(3)), std::invalid_argument);
  Appearance wrong = clean_appearance();
  wrong.spread_px = -1.0;
  EXPECT_THROW(Image{wrong}, std::invalid_argument);
  EXPECT_THROW(Image(clean_appearance(), -2.0), std::invalid_argument);  // folds within the image
  Image away(clean_appearance());
  auto markers = still();
  markers[0].at.x_m = -1.0;
  away.render(markers);
  EXPECT_FALSE(away.renderer.truth()[0].visible);
  EXPECT_TRUE(away.renderer.truth()[1].visible);
}

}  // namespace
}  // namespace trocar::optics
