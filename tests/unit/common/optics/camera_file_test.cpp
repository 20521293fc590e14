#include "common/optics/camera_file.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "file_fixture.hpp"

namespace trocar::optics {
namespace {

using config::testing::expect_parts;

class CameraFileTest : public config::testing::FileFixture {
 protected:
  std::string error_for(std::string_view text) {
    return error_of(text, [](const auto& file) { return read_camera(file); });
  }
};

constexpr const char* plain =
    "[image]\nwidth_px = 640\nheight_px = 480\n[lens]\nfx_px = 536.0\nfy_px = 536.0\ncx_px = 342.0\ncy_px = 235.0\n"
    "distortion = [-0.26, 0.1, 0, 0, 0]\n";

std::string with(std::string text, const std::string& what, const std::string& instead) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos);
  return text.replace(at, what.size(), instead);
}

TEST_F(CameraFileTest, ComesBackToTheLastBit) {
  Camera camera{2056, 1544, {1884.1 / 3.0, 1e3 / 7.0, 1044.0, 737.123456789012345, {-0.1 / 3.0, 0.183, 1e-17, -0.0065, 0.0}}, {}};
  Calibration c{.date = "2026-01-31T12:00:00Z", .rms_px = 1.0 / 3.0, .fixed_aspect = true, .columns = 9, .rows = 6, .square_m = 0.025};
  c.standard_deviation = {0.1, 0.2, 1.0 / 9.0, 0.4, {1e-3, 1e-2, 1e-4, 1e-5, 0.0}};
  c.views.push_back(
      {.file = "a \"b\"\\c\n\x01 d\u00e9.png", .pose = BoardPose{0.1, {0.1, -1.0 / 3.0, 3.0}, {1e-3, 2e-3, 0.5}}, .outlier = true});
  c.views.push_back({.file = "black.png", .left_out = "black"});
  c.views.push_back({.file = "mirrored.png", .pose = BoardPose{0.2, {}, {}}, .left_out = "mirrored"});
  camera.calibration = c;
  std::ostringstream text;
  write_camera(text, camera);
  const Camera back = read_camera(write(text.str()));
  EXPECT_EQ(back.width_px, 2056);
  EXPECT_EQ(back.height_px, 1544);
  const auto same_lens = [](const Lens& a, const Lens& b) {
    return a.fx_px == b.fx_px && a.fy_px == b.fy_px && a.cx_px == b.cx_px && a.cy_px == b.cy_px && a.distortion == b.distortion;
  };
  EXPECT_TRUE(same_lens(back.lens, camera.lens));
  ASSERT_TRUE(back.calibration.has_value());
  EXPECT_TRUE(same_lens(back.calibration->standard_deviation, c.standard_deviation));
  EXPECT_EQ(back.calibration->date, c.date);
  EXPECT_EQ(back.calibration->rms_px, c.rms_px);
  EXPECT_EQ(back.calibration->square_m, c.square_m);
  EXPECT_TRUE(back.calibration->fixed_aspect);
  EXPECT_EQ(back.calibration->columns, 9);
  EXPECT_EQ(back.calibration->rows, 6);
  ASSERT_EQ(back.calibration->views.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const CalibratedView& x = back.calibration->views[i];
    const CalibratedView& y = c.views[i];
    EXPECT_EQ(x.file, y.file);
    EXPECT_EQ(x.left_out, y.left_out);
    EXPECT_EQ(x.outlier, y.outlier);
    ASSERT_EQ(x.pose.has_value(), y.pose.has_value());
    if (!x.pose) continue;
    EXPECT_EQ(x.pose->rms_px, y.pose->rms_px);
    EXPECT_EQ(x.pose->rotation_rad, y.pose->rotation_rad);
    EXPECT_EQ(x.pose->translation_m, y.pose->translation_m);
  }
}

TEST_F(CameraFileTest, WritesNamesThatAreNotUtf8SoThatTheyCanBeRead) {
  Camera camera{640, 480, {500.0, 500.0, 320.0, 240.0, {}}, Calibration{.date = "d", .columns = 9, .rows = 6, .square_m = 0.025}};
  camera.calibration->views.push_back({.file = "a\xFF\xC3(\xED\xA0\x80\xF0\x9F", .left_out = "x"});
  std::ostringstream text;
  write_camera(text, camera);
  EXPECT_EQ(read_camera(write(text.str())).calibration->views[0].file.front(), 'a');
}

TEST_F(CameraFileTest, NeedsNoCalibration) {
  const Camera camera = read_camera(write(plain));
  EXPECT_FALSE(camera.calibration.has_value());
  EXPECT_EQ(camera.lens.distortion[1], 0.1);
  const Camera thesis = read_camera(TROCAR_SHARE "/cameras/thesis.toml");
  EXPECT_EQ(thesis.width_px, 2056);
  EXPECT_EQ(thesis.lens.cx_px, 1044.0);
}

TEST_F(CameraFileTest, RefusesByLineAndKey) {
  expect_parts(error_for(with(plain, "width_px = 640\n", "")), {":1: image.width_px: missing", "2056"});
  expect_parts(error_for(with(plain, "fx_px = 536.0", "fx_px = 0")), {":5: lens.fx_px = 0", "1884"});
  expect_parts(error_for(with(plain, "fx_px = 536.0", "fx_px = nan")), {":5: lens.fx_px = nan"});
  expect_parts(error_for(with(plain, ", 0, 0, 0]", "]")), {":9: lens.distortion", "array of 5 numbers", "[k1, k2, p1, p2, k3]"});
  expect_parts(error_for(std::string(plain) + "skew = 0.0\n"), {":10: lens.skew", "unknown key"});
  expect_parts(error_for(std::string(plain) + "[calibration]\ndate = \"d\"\nrms_px = 0.4\nboard = [9]\nsquare_m = 0.025\n"),
               {":13: calibration.board", "[9, 6]"});
}

}  // namespace
}  // namespace trocar::optics
