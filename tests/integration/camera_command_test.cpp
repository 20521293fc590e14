// `trocar camera` as a person types it.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

const std::filesystem::path photographs = std::filesystem::path(TROCAR_TEST_DATA) / "calibration-left";

Words all_photographs() {
  Words files;
  for (const char* number : {"01", "02", "03", "04", "05", "06", "07", "08", "09", "11", "12", "13", "14"})
    files.push_back((photographs / (std::string("left") + number + ".jpg")).string());
  return files;
}

Words operator+(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

double number_of(const std::string& json, const std::string& key) {
  const std::string name = "\"" + key + "\": ";
  const std::size_t at = json.find(name);
  EXPECT_NE(at, std::string::npos) << key << " in " << json;
  return at == std::string::npos ? std::nan("") : std::stod(json.substr(at + name.size()));
}

// The scratch folder holds nothing but the programs' output and what the test itself put there.
std::string leftovers(const Scratch& scratch, const Words& own) {
  std::string names;
  for (const auto& entry : std::filesystem::directory_iterator(scratch.folder())) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("trocar", 0) != 0 && std::find(own.begin(), own.end(), name) == own.end()) names += name + " ";
  }
  return names;
}

// A grey image of one value, or a chessboard of 11 x 8 squares in it.
std::string pgm(int width, int height, int value, bool board = false) {
  std::ostringstream text;
  text << "P5\n" << width << ' ' << height << "\n255\n";
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const int i = u / 40 - 1, j = v / 40 - 1;
      const bool dark = board && i >= 0 && i < 11 && j >= 0 && j < 8 && (i + j) % 2 == 0;
      text.put(static_cast<char>(dark ? 10 : value));
    }
  return text.str();
}

class CameraCommand : public ::testing::Test {
 protected:
  Words calibrate(const Words& images, const Words& more = {}) const {
    return Words{"camera", "calibrate"} + images +
           Words{"--board", "9x6", "--square-m", "0.025", "--out", (scratch / "camera.toml").string()} + more;
  }
  const Scratch scratch;
};

TEST_F(CameraCommand, CalibratesFromThePhotographs) {
  Program program(scratch, "trocar", calibrate(all_photographs(), {"--fixed-aspect", "--json"}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  const std::string json = program.out();
  EXPECT_EQ(json.find("{\"rms_px\": "), 0u) << json;
  EXPECT_EQ(json.find('\n'), json.size() - 1) << json;
  EXPECT_LE(number_of(json, "rms_px"), 0.40);
  EXPECT_NEAR(number_of(json, "fx_px"), 535.916, 0.5);
  EXPECT_NEAR(number_of(json, "fy_px"), 535.916, 0.5);
  EXPECT_NEAR(number_of(json, "cx_px"), 342.283, 0.5);
  EXPECT_NEAR(number_of(json, "cy_px"), 235.571, 0.5);
  EXPECT_EQ(number_of(json, "views_used"), 13);
  EXPECT_NE(json.find("\"distortion\": [-0.266"), std::string::npos) << json;
  EXPECT_NE(json.find("\"left_out\": []"), std::string::npos) << json;
  const std::string said = program.errors();  // the one outlier, by name and with the reason
  for (const char* word : {"trocar: ", "left02.jpg: outlier: RMS 1.18", "times the median", "--window spacing"})
    EXPECT_NE(said.find(word), std::string::npos) << said;
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  EXPECT_EQ(leftovers(scratch, {"camera.toml", "camera.svg"}), "");
  EXPECT_NE(read_text(scratch / "camera.svg").find("</svg>"), std::string::npos);
  EXPECT_NE(read_text(scratch / "camera.toml").find("fixed_aspect = true"), std::string::npos);
}

TEST_F(CameraCommand, RectifiesImagesAndPointsWithWhatItCalibrated) {
  Program program(scratch, "trocar",
                  calibrate(all_photographs(), {"--window", "spacing", "--picture", (scratch / "residuals.svg").string()}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_EQ(program.errors(), "");
  EXPECT_NE(program.out().find("left14.jpg RMS 0."), std::string::npos) << program.out();
  const std::string camera = (scratch / "camera.toml").string();

  const Words two{(photographs / "left01.jpg").string(), (photographs / "left02.jpg").string()};
  Program images(scratch, "trocar",
                 Words{"camera", "rectify"} + two + Words{"--camera", camera, "--out", (scratch / "flat").string() + "/", "--json"});
  ASSERT_EQ(images.wait(answer_s), 0) << images.errors();
  EXPECT_EQ(number_of(images.out(), "images"), 2);
  EXPECT_EQ(number_of(images.out(), "beyond_fold_px"), 0);
  EXPECT_EQ(read_text(scratch / "flat" / "left02.png").substr(1, 3), "PNG");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch / "flat"), {}), 2);

  // There by either inverse, and back: the same points to 1e-6 px.
  std::ostringstream points;
  points << "u_px,v_px\n";
  for (int v = 0; v < 480; v += 37)
    for (int u = 0; u < 640; u += 31) points << u << ',' << v << '\n';
  write_text(scratch / "points.csv", points.str());
  for (const std::string method : {"newton", "fixed-point"}) {
    const std::string flat = (scratch / (method + ".csv")).string(), back = (scratch / "back.csv").string();
    Program there(scratch, "trocar",
                  {"camera", "rectify", "--points", (scratch / "points.csv").string(), "--camera", camera, "--out", flat, "--method",
                   method, "--json"});
    ASSERT_EQ(there.wait(answer_s), 0) << there.errors();
    EXPECT_EQ(number_of(there.out(), "ok"), number_of(there.out(), "points"));
    EXPECT_GT(number_of(there.out(), "iterations"), method == "newton" ? 1 : 6);
    EXPECT_LT(number_of(there.out(), "iterations"), method == "newton" ? 7 : 30);
    std::istringstream rows(read_text(flat));
    std::ostringstream again;
    std::string row;
    std::getline(rows, row);
    EXPECT_EQ(row, "u_px,v_px,iterations,status");
    again << "u_px,v_px\n";
    while (std::getline(rows, row)) {
      EXPECT_EQ(row.substr(row.rfind(',') + 1), "ok");
      again << row.substr(0, row.find(',', row.find(',') + 1)) << '\n';
    }
    write_text(scratch / "flat.csv", again.str());
    Program home(scratch, "trocar",
                 {"camera", "rectify", "--points", (scratch / "flat.csv").string(), "--camera", camera, "--out", back, "--distort"});
    ASSERT_EQ(home.wait(answer_s), 0) << home.errors();
    std::istringstream seen(points.str()), got(read_text(back));
    std::string a, b;
    std::getline(seen, a);
    std::getline(got, b);
    int compared = 0;
    while (std::getline(seen, a) && std::getline(got, b)) {
      EXPECT_NEAR(std::stod(a), std::stod(b), 1e-6);
      EXPECT_NEAR(std::stod(a.substr(a.find(',') + 1)), std::stod(b.substr(b.find(',') + 1)), 1e-6);
      ++compared;
    }
    EXPECT_EQ(compared, 13 * 21);
  }
}

TEST_F(CameraCommand, NamesPointsBeyondTheFoldAndGivesThemNoNumber) {
  write_text(scratch / "fisheye.toml",
             "[image]\nwidth_px = 1000\nheight_px = 800\n[lens]\nfx_px = 500.0\nfy_px = 500.0\ncx_px = 500.0\ncy_px = 400.0\ndistortion = "
             "[-0.3, 0, 0, 0, 0]\n");
  write_text(scratch / "points.csv", "u_px,v_px\n500,400\n900,400\n600,400\n");
  const std::string out = (scratch / "out.csv").string();
  Program program(
      scratch, "trocar",
      {"camera", "rectify", "--points", (scratch / "points.csv").string(), "--camera", (scratch / "fisheye.toml").string(), "--out", out});
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_NE(program.errors().find("points.csv:3: 1 of 3 points"), std::string::npos) << program.errors();
  const std::string text = read_text(out);
  EXPECT_NE(text.find("\n500,400,0,ok\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\nnan,nan,"), std::string::npos) << text;
  EXPECT_NE(text.find(",beyond_fold\n"), std::string::npos) << text;
  // A camera that comes with trocar, by its name.
  Program thesis(scratch, "trocar",
                 {"camera", "rectify", "--points", (scratch / "points.csv").string(), "--camera", "thesis", "--out", out});
  EXPECT_EQ(thesis.wait(answer_s), 0) << thesis.errors();
  EXPECT_EQ(thesis.errors(), "");
}

// One bad image among good ones: it is named, and the rest is calibrated.
TEST_F(CameraCommand, NamesTheGapAndGoesOn) {
  write_text(scratch / "black.pgm", pgm(640, 480, 0));
  write_text(scratch / "larger.pgm", pgm(640, 480, 240, true));
  const std::string photograph = read_text(photographs / "left03.jpg");
  write_text(scratch / "cut.jpg", std::string_view(photograph).substr(0, photograph.size() / 2));
  write_text(scratch / "text.png", "no image");
  write_text(scratch / "empty.png", "");
  Words images = all_photographs();
  for (const char* name : {"black.pgm", "larger.pgm", "cut.jpg", "text.png", "empty.png"})
    images.insert(images.begin(), (scratch / name).string());
  Program program(scratch, "trocar", calibrate(images, {"--fixed-aspect", "--json"}));
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_NEAR(number_of(program.out(), "fx_px"), 535.916, 0.5);
  EXPECT_EQ(number_of(program.out(), "images"), 18);
  EXPECT_EQ(number_of(program.out(), "views_used"), 13);
  const std::string said = program.errors();
  for (const char* word : {"black.pgm: left out: the frame is black", "larger.pgm: left out: ", "cut.jpg: left out: truncated",
                           "text.png: left out: ", "empty.png: left out: the file is empty"})
    EXPECT_NE(said.find(word), std::string::npos) << word << ": " << said;
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 6) << said;
}

TEST_F(CameraCommand, RefusesToCalibrateAndLeavesNothing) {
  write_text(scratch / "small.pgm", pgm(320, 240, 200));
  write_text(scratch / "black.pgm", pgm(640, 480, 0));
  const Words own{"small.pgm", "black.pgm"};
  const auto refuses = [&](const Words& arguments, const Words& words) {
    expect_refusal(scratch, "trocar", arguments, words);
    EXPECT_EQ(leftovers(scratch, own), "");
  };
  const Words all = all_photographs();
  refuses(calibrate({all[0], all[1]}), {"2 of 2 images", "at least 3", "10 to 20"});
  refuses(calibrate({all[0], all[1], (scratch / "black.pgm").string()}), {"2 of 3 images", "black.pgm: the frame is black"});
  refuses(calibrate({(scratch / "black.pgm").string()}), {"0 of 1 images", "black.pgm: the frame is black"});
  refuses(calibrate(all + Words{(scratch / "small.pgm").string()}), {"small.pgm: 320 x 240 px", "left01.jpg is 640 x 480 px", "leave out"});
  refuses(calibrate(all + Words{(scratch / "none.png").string()}), {"none.png: there is no such file"});
  refuses(calibrate({scratch.folder().string()}), {"this is a folder"});
  refuses(calibrate(all + Words{all[2]}), {"left03.jpg: given twice"});
  refuses({"camera", "calibrate", all[0], "--board", "9x6", "--square-m", "0.025", "--out", "/nowhere/camera.toml"},
          {"/nowhere/camera.toml", "cannot be written"});
  // Another board than the one in the picture, smaller and larger.
  for (const char* board : {"8x6", "10x7"}) {
    Words wrong = calibrate({all[2], all[3], all[4]});
    *std::find(wrong.begin(), wrong.end(), "9x6") = board;
    refuses(wrong, {"0 of 3 images", "left03.jpg: ",
                    std::string(board) == "8x6" ? "goes on beyond 8 x 6" : "a grid of 9 x 6 is seen, the board should have 10 x 7"});
  }
}

TEST_F(CameraCommand, RefusesToRectifyAndLeavesNothing) {
  write_text(scratch / "small.pgm", pgm(320, 240, 200));
  write_text(scratch / "camera.toml",
             "[image]\nwidth_px = 640\nheight_px = 480\n[lens]\nfx_px = 536.0\nfy_px = 536.0\ncx_px = 342.0\ncy_px = 235.0\ndistortion = "
             "[-0.26, 0.1, 0, 0, 0]\n");
  write_text(scratch / "bad.toml", "[image]\nwidth_px = 640\nheight_px = 480\n[lens]\nfx_px = -1.0\n");
  write_text(scratch / "points.csv", "u_px,v_px\n1,x\n");
  const std::string photograph = read_text(photographs / "left03.jpg");
  write_text(scratch / "cut.jpg", std::string_view(photograph).substr(0, photograph.size() / 2));
  std::filesystem::create_directory(scratch / "left01");
  const Words own{"small.pgm", "camera.toml", "bad.toml", "points.csv", "cut.jpg", "left01"};
  const std::string camera = (scratch / "camera.toml").string(), out = (scratch / "out").string();
  const std::string first = (photographs / "left01.jpg").string();
  const auto refuses = [&](const Words& what, const std::string& with, const Words& words) {
    expect_refusal(scratch, "trocar", Words{"camera", "rectify"} + what + Words{"--camera", with, "--out", out}, words);
    EXPECT_EQ(leftovers(scratch, own), "");
  };
  refuses({first, (scratch / "small.pgm").string()}, camera, {"small.pgm: 320 x 240 px", "640 x 480 px"});
  refuses({first, (scratch / "cut.jpg").string()}, camera, {"cut.jpg: truncated"});
  refuses({first, first}, camera, {"left01.jpg: would become left01.png"});
  refuses({first}, (scratch / "bad.toml").string(), {"bad.toml:5: lens.fx_px = -1", "1884"});
  refuses({first}, (scratch / "none.toml").string(), {"none.toml"});
  refuses({first}, "nobody", {"nobody", "thesis"});
  refuses({"--points", (scratch / "points.csv").string()}, camera, {"points.csv:2: v_px = \"x\""});
  expect_refusal(scratch, "trocar", {"camera", "rectify", first, "--camera", camera, "--out", (scratch / "left01").string()},
                 {"left01: is there already", "new folder"});
}

TEST_F(CameraCommand, SaysHowItIsUsed) {
  for (const Words& wrong :
       {Words{"camera"}, Words{"camera", "calibrate", "a.png"}, calibrate({"a.png"}, {"--radial", "4"}),
        calibrate({"a.png"}, {"--window", "0"}), Words{"camera", "calibrate", "a.png", "--board", "9", "--square-m", "1", "--out", "x"},
        Words{"camera", "calibrate", "a.png", "--board", "2x9", "--square-m", "1", "--out", "x"},
        Words{"camera", "rectify", "--camera", "thesis", "--out", "x"}}) {
    Program program(scratch, "trocar", wrong);
    EXPECT_EQ(program.wait(answer_s), 2) << program.errors();
    EXPECT_NE(program.errors(), "");
  }
  for (const char* command : {"calibrate", "rectify"}) {
    Program help(scratch, "trocar", {"camera", command, "--help"});
    EXPECT_EQ(help.wait(answer_s), 0);
    EXPECT_NE(help.out().find(std::string("Example: trocar camera ") + command), std::string::npos) << help.out();
  }
  Program all(scratch, "trocar", {"--help"});
  EXPECT_EQ(all.wait(answer_s), 0);
  EXPECT_NE(all.out().find("trocar camera calibrate"), std::string::npos) << all.out();
}

}  // namespace
}  // namespace trocar::testing
