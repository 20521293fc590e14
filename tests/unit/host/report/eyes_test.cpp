#include "host/report/eyes.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <fstream>
#include <string>

#include "common/config/user_error.hpp"

namespace trocar::report {
namespace {

class EyesTest : public ::testing::Test {
 protected:
  EyesTest() {
    std::string name = (std::filesystem::temp_directory_path() / "eyes-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~EyesTest() override { std::filesystem::remove_all(folder_); }
  void put(const char* file, const std::string& text) const { std::ofstream(folder_ / file) << text; }
  void put_summary(const char* frames) const {
    put("markers.toml", std::string("source = \"a camera\"\nclock = \"rig\"\ntime_uncertainty_s = 2e-05\nframes = ") + frames +
                            "\nframes_lost = 1\nframes_dropped = 2\nmarkers = 2\nmarkers_not_seen = 1\nfewest_markers = 1\n"
                            "track_s_p50 = 0.005\ntrack_s_p99 = 0.007\n");
  }
  std::filesystem::path folder_{};
};

TEST_F(EyesTest, ComparesFramesByTheirNumbers) {
  EXPECT_FALSE(read_eyes(folder_));
  put_summary("2");
  put("markers.csv",
      "frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid\n"
      "5,0.1,0,0,10,20,0,0,1,1\n5,0.1,0,1,30,20,0.005,0,1,1\n"
      "7,0.3,0,0,13,24,0.0003,0.0004,1,1\n7,0.3,0,1,nan,nan,nan,nan,0.2,0\n");
  const auto alone = read_eyes(folder_);
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->error);
  EXPECT_EQ(alone->clock, "rig");
  EXPECT_EQ(alone->lost, 1);
  EXPECT_EQ(alone->dropped, 2);
  EXPECT_NEAR(alone->most_displacement_m, 5e-4, 1e-12);
  ASSERT_EQ(alone->course.size(), 2U);
  EXPECT_NEAR(alone->course[1].displacement_m, 5e-4, 1e-12);
  EXPECT_TRUE(std::isnan(alone->course[1].error_px));
  // Frames 4 and 6 were not tracked; of frame 7 one marker is off by (0.3, 0.4) px, the other was not seen.
  put("markers_truth.csv",
      "frame,t_s,row,col,u_px,v_px,x_m,y_m,visible\n4,0,0,0,0,0,0,0,1\n4,0,0,1,0,0,0,0,1\n"
      "5,1,0,0,10,20,0,0,1\n5,1,0,1,30,20,0.005,0,1\n6,2,0,0,99,99,9,9,1\n6,2,0,1,99,99,9,9,1\n"
      "7,3,0,0,12.7,23.6,0.0003,0.0003,1\n7,3,0,1,33,24,0.0053,0,0\n");
  const auto compared = read_eyes(folder_);
  ASSERT_TRUE(compared && compared->error);
  EXPECT_EQ(compared->error->places, 3U);
  EXPECT_NEAR(compared->error->worst_px, 0.5, 1e-12);
  EXPECT_NEAR(compared->error->rms_px, std::sqrt(0.25 / 3.0), 1e-12);
  EXPECT_NEAR(compared->error->worst_m, 1e-4, 1e-15);
  EXPECT_NEAR(compared->error->rms_m, 1e-4 / std::sqrt(3.0), 1e-15);
  EXPECT_NEAR(compared->course[0].error_px, 0.0, 1e-12);
  EXPECT_NEAR(compared->course[1].error_px, 0.5, 1e-12);
}

TEST_F(EyesTest, RefusesWhatIsNoTrackOfThisKind) {
  put_summary("1");
  put("markers.csv", "frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid\n5,0.1,0,0,10,20,0,0,1,1\n");
  try {
    (void)read_eyes(folder_);
    ADD_FAILURE();
  } catch (const config::UserError& e) {
    EXPECT_NE(std::string(e.what()).find("ends within a frame"), std::string::npos) << e.what();
  }
  put("markers.toml", "source = 3\n");
  EXPECT_THROW((void)read_eyes(folder_), config::UserError);
}

}  // namespace
}  // namespace trocar::report
