// `trocar camera render`, `grab`, `list` and `trocar track` as a person types them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <sstream>

#include "common/config/csv.hpp"
#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

// The thesis's camera, every third pixel, so that images are small.
constexpr const char* small_camera =
    "[image]\nwidth_px = 686\nheight_px = 514\n[lens]\nfx_px = 628.0\nfy_px = 628.0\ncx_px = 348.0\ncy_px = 246.0\n"
    "distortion = [-0.268, 0.183, -0.00096, -0.00650, 0.0]\n";

class TrackCommand : public ::testing::Test {
 protected:
  TrackCommand() { write_text(scratch / "camera.toml", small_camera); }
  [[nodiscard]] std::string path(const std::string& name) const { return (scratch / name).string(); }
  void render(const Words& more, int frames = 8) const {
    Words words{"camera",      "render",      "--camera",         path("camera.toml"),
                "--rows",      "7",           "--columns",        "9",
                "--spacing-m", "0.008",       "--diameter-m",     "0.0036",
                "--m-per-px",  "2.37e-4",     "--displacement-m", "0.008",
                "--speed-m-s", "0.02",        "--frames",         std::to_string(frames),
                "--out",       path("frames")};
    words.insert(words.end(), more.begin(), more.end());
    Program program(scratch, "trocar", words);
    ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  }
  [[nodiscard]] Words track(const Words& sources, const Words& more = {}) const {
    Words words{"track"};
    words.insert(words.end(), sources.begin(), sources.end());
    for (const char* word : {"--rows", "7", "--columns", "9", "--spacing-m", "0.008", "--camera"}) words.emplace_back(word);
    words.push_back(path("camera.toml"));
    words.insert(words.end(), {"--out", path("markers.csv")});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  [[nodiscard]] config::Csv markers() const {
    return config::Csv::load(scratch / "markers.csv", {"frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid"}, config::NotANumber::Allowed);
  }
  [[nodiscard]] config::Csv truth() const {
    return config::Csv::load(scratch / "frames" / "truth.csv", {"frame,t_s,row,col,u_px,v_px,x_m,y_m,visible"});
  }
  const Scratch scratch;
};

TEST_F(TrackCommand, FollowsWhatWasRendered) {
  render({"--setting", "hard", "--motion", "insertion", "--format", "bayer"});
  Program program(scratch, "trocar",
                  track({path("frames")}, {"--bayer", "--json", "--covariance", path("covariance.csv"), "--picture", path("markers.png"),
                                           "--pose-out", path("pose.toml")}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_NE(program.out().find("\"frames\": 8, \"frames_lost\": 0"), std::string::npos) << program.out();
  EXPECT_NE(program.out().find("\"clock\": \"rate\""), std::string::npos) << program.out();
  const config::Csv m = markers(), t = truth();
  ASSERT_EQ(m.rows(), 8u * 63u);
  ASSERT_EQ(t.rows(), m.rows());
  double pixels = 0.0, metres = 0.0;
  for (std::size_t i = 0; i < m.rows(); ++i) {
    for (const std::size_t c : {0u, 2u, 3u}) ASSERT_EQ(m(i, c), t(i, c)) << i;
    ASSERT_NEAR(m(i, 1), t(i, 1), 1e-9) << i;
    ASSERT_EQ(m(i, 9), 1.0) << i;
    pixels += std::pow(m(i, 4) - t(i, 4), 2) + std::pow(m(i, 5) - t(i, 5), 2);
    metres += std::pow(m(i, 6) - t(i, 6), 2) + std::pow(m(i, 7) - t(i, 7), 2);
  }
  EXPECT_LT(std::sqrt(pixels / static_cast<double>(m.rows())), 0.15);
  EXPECT_LT(std::sqrt(metres / static_cast<double>(m.rows())), 0.15 * 2.37e-4);
  const config::Csv c = config::Csv::load(scratch / "covariance.csv", {"frame,row,col,xx_m2,xy_m2,yy_m2"});
  EXPECT_EQ(c.rows(), m.rows());
  for (std::size_t i = 0; i < c.rows(); ++i) EXPECT_GT(c(i, 3) * c(i, 5), c(i, 4) * c(i, 4));
  EXPECT_GT(std::filesystem::file_size(scratch / "markers.png"), 10000u);
  // The same again with the thesis's method, and in the pose that the first run found.
  Program again(scratch, "trocar", track({path("frames")}, {"--bayer", "--method", "correlation", "--pose", path("pose.toml")}));
  EXPECT_EQ(again.wait(answer_s), 0) << again.errors();
  EXPECT_EQ(markers().rows(), m.rows());
}

TEST_F(TrackCommand, TheUsersCornersSayWhoIsWho) {
  render({}, 1);
  const config::Csv t = truth();
  const auto corner = [&](std::size_t i) { return std::to_string(t(i, 4) + 2.0) + "," + std::to_string(t(i, 5) - 2.0); };
  // Half a turn about: row 0 is the uppermost.
  Program program(scratch, "trocar",
                  track({path("frames")}, {"--diameter-m", "0.0036", "--corners", corner(62), corner(54), corner(0), corner(8)}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  const config::Csv m = markers();
  EXPECT_NEAR(m(0, 4), t(62, 4), 0.1);
  EXPECT_NEAR(m(0, 5), t(62, 5), 0.1);
  EXPECT_NEAR(m(0, 6), 0.0, 2e-5);  // its own frame begins there
}

TEST_F(TrackCommand, DamagedDarkAndMissingFramesAreGapsByName) {
  render({"--motion", "shear"}, 8);
  std::filesystem::resize_file(scratch / "frames" / "frame_000003.png", 1000);
  std::ofstream black(scratch / "frames" / "frame_000005.png", std::ios::binary);
  black << "P5\n686 514\n255\n" << std::string(686 * 514, '\0');
  black.close();
  Program program(scratch, "trocar", track({path("frames")}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_NE(program.errors().find("frame_000003.png: frame 3 is lost: truncated"), std::string::npos) << program.errors();
  EXPECT_NE(program.errors().find("frame 5: no marker is seen"), std::string::npos) << program.errors();
  EXPECT_NE(program.out().find("1 frames lost"), std::string::npos) << program.out();
  const config::Csv m = markers();
  ASSERT_EQ(m.rows(), 7u * 63u);
  for (std::size_t i = 0; i < m.rows(); ++i) EXPECT_EQ(m(i, 9), m(i, 0) == 5.0 ? 0.0 : 1.0);
  EXPECT_TRUE(std::isnan(m(4 * 63, 4)));  // frame 5, nothing invented
}

TEST_F(TrackCommand, RefusesWhatCannotBe) {
  render({}, 1);
  const std::string frame = path("frames/frame_000000.png");
  const auto refuses = [&](const Words& arguments, const Words& said) {
    expect_refusal(scratch, "trocar", arguments, said);
    EXPECT_FALSE(std::filesystem::exists(scratch / "markers.csv"));
  };
  write_text(scratch / "black.pgm", "P5\n686 514\n255\n" + std::string(686 * 514, '\0'));
  refuses(track({path("black.pgm")}), {"black.pgm: frame 0: 0 dark dots were found"});
  Words wrong = track({frame});
  *std::ranges::find(wrong, "7") = "8";
  refuses(wrong, {"a grid of 7 rows and 9 columns", "--rows"});
  write_text(scratch / "small.pgm", "P5\n64 48\n255\n" + std::string(64 * 48, '\x7f'));
  refuses(track({path("small.pgm")}), {"64 x 48 px", "686 x 514"});
  refuses(track({path("none.png")}), {"none.png: there is no such file"});
  refuses(track({frame}, {"--pose", path("camera.toml")}), {"rotation_rad"});
  refuses(track({frame}, {"--corners", "10,500", "600,500", "600,10", "10,10"}), {"markers were found where the grid should be"});
  refuses(track({frame}, {"--corners", "10,10", "600,10", "600,500", "10,500"}), {"--corners", "seen from behind", "row 0 column 0"});
  refuses(track({"stream:" + path("socket/none")}), {"no camera is served there"});
  refuses(track({frame}, {"--picture", path("markers.xyz")}), {"markers.xyz: no kind of image", ".png"});
  expect_refusal(scratch, "trocar-bench", {"--out", path("run"), "--camera-socket", path("nowhere/socket")},
                 {"no socket can be made there"});
  expect_refusal(scratch, "trocar-bench", {"--experiment", "haptic", "--out", path("run"), "--camera-socket", path("socket")},
                 {"no tissue"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "run"));
  const std::string rig = scratch.make_rig().string();
  expect_refusal(scratch, "trocar-plant", {"--rig", rig, "--no-tissue", "--camera-socket", path("socket")}, {"no tissue to look at"});
  expect_refusal(scratch, "trocar-plant", {"--rig", rig, "--plant", "ubc_twin_haptic", "--camera-socket", path("socket")}, {"no [camera]"});
  expect_refusal(scratch, "trocar-plant", {"--rig", rig, "--camera-socket", path("socket"), "--camera-truth", path("nowhere/truth.csv")},
                 {"nowhere"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "socket"));
  expect_refusal(scratch, "trocar", {"camera", "render", "--out", path("frames")}, {"frames: is there already"});
  std::string folding = small_camera;
  folding.replace(folding.find("-0.268"), 6, "-2.268");
  write_text(scratch / "folding.toml", folding);
  expect_refusal(scratch, "trocar", {"camera", "render", "--camera", path("folding.toml"), "--out", path("other")},
                 {"folding.toml", "does not see the phantom's plane"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "other"));
  Program usage(scratch, "trocar", track({frame}, {"--corners", "1,2", "3,4", "5,6", "7"}));
  EXPECT_EQ(usage.wait(answer_s), 2);
  for (const Words& help : {Words{"track", "--help"}, Words{"camera", "render", "--help"}, Words{"camera", "grab", "--help"}}) {
    Program program(scratch, "trocar", help);
    EXPECT_EQ(program.wait(answer_s), 0);
    EXPECT_NE(program.out().find("Example: trocar "), std::string::npos) << program.out();
  }
}

// The camera over the simulated phantom, from the bench's process to the tracker's.
TEST_F(TrackCommand, WatchesTheBenchInLockStep) {
  (void)scratch.make_rig();
  const std::string experiment = scratch.make_experiment().string();
  Program bench(scratch, "trocar-bench", {"--experiment", experiment, "--out", path("run"), "--camera-socket", path("camera.socket")});
  ASSERT_TRUE(bench.wait_for("camera at", answer_s)) << bench.errors();
  Program program(scratch, "trocar",
                  {"track", "stream:" + path("camera.socket"), "--camera", "thesis_half", "--out", path("markers.csv"), "--json"});
  ASSERT_EQ(program.wait(100.0), 0) << program.errors();
  ASSERT_EQ(bench.wait(answer_s), 0) << bench.errors();
  EXPECT_NE(program.out().find("\"frames_lost\": 0, \"frames_dropped\": 0"), std::string::npos) << program.out();
  EXPECT_NE(program.out().find("\"clock\": \"rig\""), std::string::npos) << program.out();
  const config::Csv m = markers();
  const config::Csv t = config::Csv::load(scratch / "run" / "markers_truth.csv", {"frame,t_s,row,col,u_px,v_px,x_m,y_m,visible"});
  ASSERT_EQ(m.rows(), t.rows());
  double squares = 0.0, moved = 0.0;
  std::size_t seen = 0, wrong = 0;
  for (std::size_t i = 0; i < m.rows(); ++i) {
    moved = std::max(moved, std::hypot(t(i, 6) - t(i % 441, 6), t(i, 7) - t(i % 441, 7)));
    if (m(i, 9) == 0.0) continue;
    const double d = std::hypot(m(i, 4) - t(i, 4), m(i, 5) - t(i, 5));
    squares += d * d;
    wrong += d > 5.0 ? 1U : 0U;
    ++seen;
  }
  EXPECT_GT(moved, 1e-3);  // the needle was in the tissue
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(static_cast<double>(seen), 0.99 * static_cast<double>(m.rows()));
  EXPECT_LT(std::sqrt(squares / static_cast<double>(seen)), 0.05);
}

// A camera on the loopback, in another process.
class FakeCamera : public TrackCommand {
 protected:
  FakeCamera() : camera(scratch, "../tests-bin/fake_camera", {}) { ready = camera.wait_for("fake_camera: ready", 5.0); }
  Program camera;
  bool ready{};
};

TEST_F(FakeCamera, IsListedAndItsFramesGrabbed) {
  ASSERT_TRUE(ready) << camera.out();
  Program list(scratch, "trocar", {"camera", "list"});
  EXPECT_EQ(list.wait(answer_s), 0) << list.errors();
  EXPECT_NE(list.out().find("GV01"), std::string::npos) << list.out();
  Program grab(scratch, "trocar", {"camera", "grab", "aravis:127.0.0.1", "--frames", "20", "--rate-hz", "50", "--out", path("grabbed")});
  ASSERT_EQ(grab.wait(answer_s), 0) << grab.errors();
  EXPECT_NE(grab.out().find("20 frames into"), std::string::npos) << grab.out();
  EXPECT_NE(grab.out().find("the camera's clock is"), std::string::npos) << grab.out();
  std::ifstream table(scratch / "grabbed" / "frames.csv");
  std::string line;
  std::getline(table, line);
  EXPECT_EQ(line, "number,t_s,arrival_s,file");
  double last_number = -1.0, last_t = -1.0;
  int rows = 0;
  while (std::getline(table, line)) {
    double number = 0.0, t = 0.0;
    char comma = 0;
    std::istringstream(line) >> number >> comma >> t;
    EXPECT_GT(number, last_number);
    EXPECT_GT(t, last_t);
    last_number = number;
    last_t = t;
    ++rows;
    EXPECT_TRUE(std::filesystem::exists(scratch / "grabbed" / line.substr(line.rfind(',') + 1)));
  }
  EXPECT_EQ(rows, 20);
}

TEST_F(FakeCamera, BesideARigItsFramesHaveTheRigsTime) {
  ASSERT_TRUE(ready) << camera.out();
  const std::string rig_file = scratch.make_rig().string(), domain = std::to_string(own_domain());
  Program plant(scratch, "trocar-plant", {"--rig", rig_file, "--no-tissue"});
  ASSERT_TRUE(plant.wait_for("trocar-plant", answer_s)) << plant.errors();
  const double before_s = steady_s();  // the controller's zero is later
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort"});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();
  Program grab(scratch, "trocar",
               {"camera", "grab", "aravis:127.0.0.1", "--frames", "10", "--rate-hz", "20", "--domain", domain, "--out", path("grabbed")});
  ASSERT_EQ(grab.wait(answer_s), 0) << grab.errors();
  const double after_s = steady_s();
  EXPECT_NE(grab.errors().find("times are the rig's from frame"), std::string::npos) << grab.errors();
  EXPECT_NE(grab.errors().find("held to"), std::string::npos) << grab.errors();
  std::istringstream table(read_text(scratch / "grabbed" / "frames.csv"));
  std::string line;
  std::getline(table, line);
  double first_s = 0.0, last_s = 0.0;
  while (std::getline(table, line)) {
    last_s = std::stod(line.substr(line.find(',') + 1));
    if (first_s == 0.0) first_s = last_s;
  }
  EXPECT_GT(first_s, 0.0);  // not from the camera's own zero, nor from its first frame
  EXPECT_NEAR(last_s - first_s, 9.0 / 20.0, 0.3);
  EXPECT_LT(last_s, after_s - before_s);
}

TEST_F(FakeCamera, UnpluggedInMidStreamIsSaidAndNothingBeforeIsLost) {
  ASSERT_TRUE(ready) << camera.out();
  Program grab(scratch, "trocar", {"camera", "grab", "aravis:127.0.0.1", "--rate-hz", "50", "--out", path("grabbed")});
  const double give_up = steady_s() + 20.0;
  while (!std::filesystem::exists(scratch / "grabbed" / "frame_000010.png") && steady_s() < give_up) usleep(10000);
  camera.signal(SIGKILL);
  EXPECT_EQ(grab.wait(20.0), 1);
  EXPECT_NE(grab.errors().find("is gone (unplugged"), std::string::npos) << grab.errors();
  std::size_t images = 0;
  for (const auto& entry : std::filesystem::directory_iterator(scratch / "grabbed"))
    if (entry.path().extension() == ".png") ++images;
  EXPECT_GE(images, 10u);
  const std::string table = read_text(scratch / "grabbed" / "frames.csv");
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(table, '\n')), images + 1);
  EXPECT_NE(grab.out().find(std::to_string(images) + " frames into"), std::string::npos) << grab.out();
}

TEST_F(TrackCommand, ACameraThatIsNotThereIsNamed) {
  expect_refusal(scratch, "trocar", {"camera", "grab", "aravis:no-such-camera", "--frames", "1", "--out", path("grabbed")},
                 {"aravis:no-such-camera", "no such camera"});
  EXPECT_FALSE(std::filesystem::exists(scratch / "grabbed"));
}

}  // namespace
}  // namespace trocar::testing
