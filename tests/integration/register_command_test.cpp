// `trocar camera register` as a person types it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "common/capture/rig_capture.hpp"
#include "common/config/document.hpp"
#include "common/optics/camera_file.hpp"
#include "common/optics/plane.hpp"
#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

// A rig that moves and turns, and what a camera above it sees of one mark.
class RegisterCommand : public ::testing::Test {
 protected:
  void write_run(double turn_rad) const {
    const optics::PlaneView view(optics::read_camera(std::filesystem::path(TROCAR_SHARE) / "cameras/thesis.toml").lens,
                                 {{3.08, 0.11, -0.09}, {-0.01, 0.27, 0.15}});
    std::vector<Sample> samples;
    std::ofstream marks(scratch / "marks.csv");
    marks << "frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid\n";
    for (int k = 0; k < 8000; ++k) {
      const double t = 1e-3 * k, a = 1.3 * t, b = 0.9 * t + 0.4, c = 1.7 * t;
      Sample sample;
      sample.tick = static_cast<std::uint64_t>(k);
      sample.time_ns = 1'000'000LL * k;
      sample.pose = {0.02 * std::sin(a), 0.20 + 0.03 * std::sin(b), 1.57 + turn_rad * std::sin(c)};
      sample.velocity = {0.026 * std::cos(a), 0.027 * std::cos(b), turn_rad * 1.7 * std::cos(c)};
      samples.push_back(sample);
      if (k % 40 != 0) continue;
      const double co = std::cos(sample.pose[2]), si = std::sin(sample.pose[2]);
      const auto pixel = view.project({sample.pose[0] + co * 0.07 - si * 0.004, sample.pose[1] + si * 0.07 + co * 0.004});
      ASSERT_TRUE(pixel);
      if (k % 400 == 0)
        marks << k / 40 << ',' << t << ",0,0,nan,nan,nan,nan,0.1,0\n";
      else
        marks << fmt::format("{},{},0,0,{},{},0,0,0.9,1\n", k / 40, t, pixel->u_px, pixel->v_px);
    }
    capture::RigCaptureWriter writer(scratch / "capture.mcap");
    writer.write_samples(samples);
    writer.close();
  }
  Words registration(const Words& more = {}) const {
    Words words{
        "camera",   "register", "--marks", (scratch / "marks.csv").string(),        "--capture", (scratch / "capture.mcap").string(),
        "--camera", "thesis",   "--out",   (scratch / "registration.toml").string()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  const Scratch scratch;
};

TEST_F(RegisterCommand, FindsTheCameraAndTheMark) {
  write_run(0.3);
  Program program(scratch, "trocar", registration());
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_NE(program.out().find("RMS 0.000 px over"), std::string::npos) << program.out();
  EXPECT_NE(program.out().find("mark (0, 0) at (70.000"), std::string::npos) << program.out();
  const config::Document file = config::Document::load(scratch / "registration.toml");
  const auto t = file.root().table("rig_plane").numbers<3>("translation_m", {-1.0, 1.0}, "");
  EXPECT_NEAR(t[0], -0.01, 1e-7);
  EXPECT_NEAR(t[1], 0.27, 1e-7);
  EXPECT_NEAR(t[2], 0.15, 1e-7);
  EXPECT_NEAR(file.root().tables("mark").at(0).number("y_m", {-1.0, 1.0}, ""), 0.004, 1e-7);
}

TEST_F(RegisterCommand, SaysWhatTheMotionLacks) {
  write_run(0.0);
  expect_refusal(scratch, "trocar", registration(), {"marks.csv", "the tool turned by 0.000 rad", "--mark-m"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "registration.toml"));
  Program program(scratch, "trocar", registration({"--mark-m", "0.07,0.004"}));
  EXPECT_EQ(program.wait(answer_s), 0) << program.errors();
}

}  // namespace
}  // namespace trocar::testing
