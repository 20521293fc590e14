// `trocar scene check | compile | info` as a person calls it.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "harness.hpp"

namespace trocar::testing {
namespace {

using Words = std::vector<std::string>;
constexpr double answer_s = 60.0;

const std::string scene_text = R"([tissue]
model = "plane_stress"
thickness_m = 0.011
grid = { size_m = [0.1, 0.1], origin_m = [-0.05, 0.0], nodes = [11, 11], element = "quad4" }
[[tissue.material]]
young_pa = 25300.0
poisson = 0.48
[[tissue.support]]
where = "y_max"
fix = ["x", "y"]
[needle]
model = "rigid"
length_m = 0.1
[contact]
method = "embedded"
shaft_n_per_m = 34.0
tip_n_per_m = 68.0
tip_zone_m = 0.0025
)";

std::set<std::string> files_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

class SceneCommand : public ::testing::Test {
 protected:
  // The scene above with one text replaced.
  std::string scene(const std::string& from = {}, const std::string& to = {}) const {
    std::string text = scene_text;
    if (!from.empty()) {
      const std::size_t at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    }
    const auto file = work / "scene.toml";
    write_text(file, text);
    return file.string();
  }

  struct Said {
    int code{};
    std::string out{}, errors{};
  };
  Said run(const Words& arguments) const {
    Program program(scratch, "trocar", arguments);
    Said said;
    said.code = program.wait(answer_s);
    said.out = program.out();
    said.errors = program.errors();
    return said;
  }
  Said compile(const std::string& scene_file, const Words& more = {}) const {
    Words arguments{"scene", "compile", scene_file, "--out", image.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  // Exit code 1, the last line of stderr begins with the program and holds the words, and no file came or went.
  void expect_refusal(const Words& arguments, const Words& words) const {
    const auto before = files_in(work);
    const Said said = run(arguments);
    SCOPED_TRACE(said.errors);
    EXPECT_EQ(said.code, 1);
    EXPECT_TRUE(said.out.empty()) << said.out;
    ASSERT_FALSE(said.errors.empty());
    const std::size_t start = said.errors.rfind("trocar: ");
    ASSERT_NE(start, std::string::npos);
    const std::string last = said.errors.substr(start);
    EXPECT_EQ(std::count(last.begin(), last.end(), '\n'), 1);
    for (const std::string& word : words) EXPECT_NE(last.find(word), std::string::npos) << "misses " << word;
    EXPECT_EQ(files_in(work), before);
  }

  const Scratch scratch;
  const std::filesystem::path work = [this] {
    std::filesystem::create_directory(scratch / "work");
    return scratch / "work";
  }();
  const std::filesystem::path image = work / "scene.image";
  const std::filesystem::path visible = work / "scene.image.visible";
};

TEST_F(SceneCommand, CheckSaysWhatCompilingWouldCost) {
  const auto before = files_in(work);
  const Said said = run({"scene", "check", scene()});
  EXPECT_EQ(said.code, 0) << said.errors;
  for (const char* word : {"121 nodes", "100 elements", "242 unknowns", "10 of 64", "MB", "good to solve and to compile"})
    EXPECT_NE(said.out.find(word), std::string::npos) << word << " is missing in " << said.out;
  EXPECT_EQ(run({"scene", "check", "phantom"}).code, 0);
  const Said json = run({"scene", "check", scene(), "--json"});
  EXPECT_EQ(json.out.front(), '{');
  EXPECT_NE(json.out.find("\"columns\": 242, "), std::string::npos) << json.out;
  EXPECT_EQ(files_in(work).size(), before.size() + 1);  // the scene
}

TEST_F(SceneCommand, CheckAcceptsWhatCanOnlyBeSolved) {
  const std::string tissue = scene_text.substr(0, scene_text.find("[needle]"));
  write_text(work / "scene.toml", tissue);
  const Said said = run({"scene", "check", (work / "scene.toml").string()});
  EXPECT_EQ(said.code, 0) << said.errors;
  EXPECT_NE(said.out.find("to compile it needs [needle] and [contact]"), std::string::npos) << said.out;
  expect_refusal({"scene", "compile", (work / "scene.toml").string(), "--out", image.string()}, {"[needle]"});
}

TEST_F(SceneCommand, CompiledImageIsWhatInfoShows) {
  const std::string file = scene();
  const Said compiled = compile(file);
  ASSERT_EQ(compiled.code, 0) << compiled.errors;
  EXPECT_NE(compiled.errors.find("memory"), std::string::npos) << "the cost is printed before the work: " << compiled.errors;
  EXPECT_EQ(files_in(work), (std::set<std::string>{"scene.image", "scene.image.visible", "scene.toml"}));

  const std::string bytes = "\"bytes\": " + std::to_string(std::filesystem::file_size(image)) + ", ";
  const Said of_image = run({"scene", "info", image.string(), "--json"});
  EXPECT_EQ(of_image.code, 0) << of_image.errors;
  EXPECT_TRUE(of_image.errors.empty()) << of_image.errors;
  const Said of_scene = run({"scene", "info", file, "--json"});
  EXPECT_EQ(of_scene.code, 0) << of_scene.errors;
  for (const std::string& said : {of_image.out, of_scene.out}) {
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    for (const std::string& word : {bytes, std::string("\"candidates\": 121, "), std::string("\"storage\": \"float64\""),
                                    std::string("\"contacts\": 10, "), std::string("\"tick_contacts\": 10")})
      EXPECT_NE(said.find(word), std::string::npos) << word << " is missing in " << said;
  }
  EXPECT_NE(of_scene.out.find("\"compile_s\": 0."), std::string::npos) << of_scene.out;

  const std::string first = read_text(image);
  const std::string first_visible = read_text(visible);
  ASSERT_EQ(compile(file).code, 0);
  EXPECT_EQ(read_text(image), first) << "the same scene gives other bytes";
  EXPECT_EQ(read_text(visible), first_visible);
}

TEST_F(SceneCommand, OptionsChooseStorageAndFiles) {
  const std::string file = scene("method = \"embedded\"", "storage = \"float32\"");
  ASSERT_EQ(compile(file, {"--no-visible"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(visible));
  EXPECT_NE(run({"scene", "info", image.string()}).out.find("float32 costs"), std::string::npos);
  ASSERT_EQ(compile(file, {"--visible", (work / "drawn").string(), "--json"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(work / "drawn"));
}

TEST_F(SceneCommand, BadScenesAreRefusedAndNothingIsWritten) {
  struct Mistake {
    const char* right;
    const char* wrong;
    Words words;
  };
  for (const Mistake& m : std::vector<Mistake>{
           {"method =", "methodd =", {"methodd"}},
           {"poisson = 0.48", "poisson = 0.5", {"poisson", "0.5"}},
           {"fix = [\"x\", \"y\"]", "fix = [\"x\"]", {"y"}},
           {"where = \"y_max\"", "box = [[1.0, 1.0], [2.0, 2.0]]", {"support"}},
           {"\"embedded\"", "\"subdivide\"", {"subdivide", "embedded"}},
           {"model = \"rigid\"", "model = \"thesis\"\ngauge = \"22G\"", {"offline", "rigid"}},
           {"tip_zone_m = 0.0025", "tip_zone_m = 0.0025\nspacing_m = 0.0005", {"200 contacts", "64", "spacing_m"}},
           {"tip_zone_m = 0.0025",
            "tip_zone_m = 0.0025\ncorridor = { from_m = [1.0, 0.0], to_m = [1.0, 0.1], half_width_m = 0.01 }",
            {"corridor"}},
           {"tip_zone_m = 0.0025",
            "tip_zone_m = 0.0025\npoints_m = [[0.0, 0.05], [0.0, -0.01]]\nslip_force_n = [0.1, 0.1]",
            {"points_m[1]", "outside"}},
           {"tip_zone_m = 0.0025", "tip_zone_m = 0.0025\nvisible = \"nobody\"", {"nobody"}},
       }) {
    SCOPED_TRACE(m.wrong);
    Words words = m.words;
    words.push_back("scene.toml");
    expect_refusal({"scene", "compile", scene(m.right, m.wrong), "--out", image.string()}, words);
  }
}

TEST_F(SceneCommand, PlacesThatCannotBeWrittenAreRefusedBeforeTheWork) {
  const std::string file = scene();
  std::filesystem::create_directory(work / "folder");
  expect_refusal({"scene", "compile", file, "--out", (work / "folder").string()}, {"folder"});
  expect_refusal({"scene", "compile", file, "--out", (work / "none" / "scene.image").string()}, {"none"});
  expect_refusal({"scene", "compile", file, "--out", image.string(), "--visible", image.string()}, {"--visible"});
  expect_refusal({"scene", "compile", file, "--out", image.string(), "--visible", (work / "folder").string()}, {"folder"});
  const std::string large = scene("nodes = [11, 11]", "nodes = [41, 41]");
  expect_refusal({"scene", "compile", large, "--out", image.string(), "--memory", "0.01"}, {"--memory"});
}

TEST_F(SceneCommand, FailureKeepsTheImageThatWasThere) {
  ASSERT_EQ(compile(scene()).code, 0);
  const std::string before = read_text(image);
  EXPECT_EQ(compile(scene("poisson = 0.48", "poisson = 0.5")).code, 1);
  EXPECT_EQ(read_text(image), before);
}

TEST_F(SceneCommand, InterruptedCompilationLeavesNothing) {
  std::string text = scene_text;
  const std::string nodes = "nodes = [11, 11]";
  text.replace(text.find(nodes), nodes.size(), "nodes = [121, 81]");  // seconds of columns
  write_text(work / "scene.toml", text);
  const auto before = files_in(work);
  Program program(scratch, "trocar", {"scene", "compile", (work / "scene.toml").string(), "--out", image.string()});
  ASSERT_TRUE(program.wait_for("solving columns", answer_s)) << program.errors();
  program.signal(SIGINT);
  EXPECT_EQ(program.wait(answer_s), 1);
  EXPECT_NE(program.errors().find("trocar: stopped; nothing was written"), std::string::npos) << program.errors();
  EXPECT_EQ(files_in(work), before);
}

TEST_F(SceneCommand, ImagesThatAreDamagedOrForeignAreRefusedByName) {
  ASSERT_EQ(compile(scene()).code, 0);
  const std::string good = read_text(image);
  const auto bad = (work / "bad.image").string();
  write_text(bad, good.substr(0, good.size() / 2));
  expect_refusal({"scene", "info", bad}, {bad, "too early"});
  std::string flipped = good;
  flipped[good.size() / 3] = static_cast<char>(flipped[good.size() / 3] ^ 16);
  write_text(bad, flipped);
  expect_refusal({"scene", "info", bad}, {bad, "damaged"});
  std::string newer = good;
  newer[12] = static_cast<char>(newer[12] + 1);
  write_text(bad, newer);
  expect_refusal({"scene", "info", bad}, {bad, "another version"});
  write_text(bad, read_text(visible));
  expect_refusal({"scene", "info", bad}, {bad, "not a model image"});
  expect_refusal({"scene", "info", (work / "missing.image").string()}, {"missing.image"});
  expect_refusal({"scene", "info", "nobodys_scene"}, {"nobodys_scene", "phantom"});
}

TEST_F(SceneCommand, WrongUsageIsCodeTwo) {
  EXPECT_EQ(run({"scene"}).code, 2);
  EXPECT_EQ(run({"scene", "dance"}).code, 2);
  EXPECT_EQ(run({"scene", "compile", scene()}).code, 2);  // no --out
  EXPECT_EQ(compile(scene(), {"--memory", "much"}).code, 2);
  EXPECT_EQ(compile(scene(), {"--visible", "a", "--no-visible"}).code, 2);
}

}  // namespace
}  // namespace trocar::testing
