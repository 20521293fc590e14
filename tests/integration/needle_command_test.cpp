// `trocar needle bend` as a person types it.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <vector>

#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

constexpr const char* needle_text = "[needle]\nmodel = \"beam\"\ngauge = \"20G\"\nlength_m = 0.15\nelements = 16\n";

std::vector<std::vector<double>> rows_of(const std::string& text) {
  std::istringstream lines(text);
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "s_m,x_m,y_m,theta_rad");
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(std::stod(field));
  }
  return rows;
}

TEST(NeedleCommand, WritesTheShape) {
  const Scratch scratch;
  write_text(scratch / "needle.toml", needle_text);
  const std::string out = (scratch / "shape.csv").string();
  // P L^2 / EI = 1: the elastica's tip stands at 0.30172 L to the side.
  const double force = 5.3753571419360002e-3 / (0.15 * 0.15);
  std::ostringstream tip;
  tip.precision(17);
  tip << "0," << force;
  Program program(scratch, "trocar", {"needle", "bend", (scratch / "needle.toml").string(), "--tip-force", tip.str(), "--out", out});
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_EQ(program.errors(), "");
  EXPECT_NE(program.out().find("33 rows"), std::string::npos) << program.out();
  const auto rows = rows_of(read_text(out));
  ASSERT_EQ(rows.size(), 33u);
  EXPECT_EQ(rows.front(), (std::vector<double>{0.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(rows.back()[0], 0.15);
  EXPECT_NEAR(rows.back()[2] / 0.15, 0.30172, 2e-5);
}

TEST(NeedleCommand, TakesASceneANameAndManyForces) {
  const Scratch scratch;
  write_text(scratch / "scene.toml", shared_file("scenes/phantom.toml", {{"model = \"rigid\"", "model = \"beam\"\ngauge = \"22G\""}}));
  const std::string out = (scratch / "shape.csv").string();
  Program scene(scratch, "trocar",
                {"needle", "bend", (scratch / "scene.toml").string(), "--tip-force", "-0.1,0.05", "--tip-moment", "-0.001", "--at",
                 "0.05,0,0.2", "--at", "0.07,0,-0.1", "--out", out, "--json"});
  ASSERT_EQ(scene.wait(answer_s), 0) << scene.errors();
  for (const char* word : {"\"rows\": 49", "\"base_fx_n\": 0.1", "\"base_fy_n\": -0.15", "\"residual_nm\""})
    EXPECT_NE(scene.out().find(word), std::string::npos) << scene.out();
  Program name(scratch, "trocar", {"needle", "bend", "chiba_20g", "--out", out});
  ASSERT_EQ(name.wait(answer_s), 0) << name.errors();
  EXPECT_NEAR(rows_of(read_text(out)).back()[1], 0.15, 1e-15);
  Program help(scratch, "trocar", {"needle", "bend", "--help"});
  ASSERT_EQ(help.wait(answer_s), 0);
  EXPECT_NE(help.out().find("Example: trocar needle bend"), std::string::npos);
}

TEST(NeedleCommand, BendsTheTrianglesOfTheThesisAndSaysHow) {
  const Scratch scratch;
  const std::string out = (scratch / "shape.csv").string();
  const auto bend = [&](const std::string& keys, const Words& more) {
    write_text(scratch / "thesis.toml", "[needle]\nmodel = \"thesis\"\ngauge = \"20G\"\nlength_m = 0.15\n" + keys);
    Words arguments{"needle", "bend", (scratch / "thesis.toml").string(), "--out", out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Program program(scratch, "trocar", arguments);
    EXPECT_EQ(program.wait(answer_s), 0) << program.errors();
    EXPECT_EQ(program.errors(), "");
    return program.out();
  };
  const auto says = [](const std::string& said, const Words& words) {
    for (const std::string& word : words) EXPECT_NE(said.find(word), std::string::npos) << "misses \"" << word << "\": " << said;
  };
  // Fitted: at small load the tube's P L^3 / (3 EI).
  says(bend("", {"--tip-force", "0,0.001"}), {"16 rows", "16 x 4 nodes", "fitted", "the fixed point converged in"});
  auto rows = rows_of(read_text(out));
  ASSERT_EQ(rows.size(), 16u);
  EXPECT_EQ(rows.front(), (std::vector<double>{0.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(rows.back()[0], 0.15);
  EXPECT_NEAR(rows.back()[2] / (0.001 * std::pow(0.15, 3) / (3 * 5.3753571419360002e-3)), 1.0, 1e-4);
  says(bend("young_pa = 9.8e8\nelements = 15\n", {"--tip-force", "0,0.1", "--at", "0.07,0,0.1"}),
       {"E = 980 MPa (as stated)", "the fixed point diverges", "by Newton's method"});
  EXPECT_GT(rows_of(read_text(out)).back()[2], 0.01);
  const std::string json = bend("elements = 30\n", {"--tip-force", "0,0.1", "--json"});
  says(json, {"\"rows\": 31", "\"fitted\": true", "\"method\": \"newton\"", "\"fixed_point\": \"diverged\"", "\"residual_n\""});
  const std::string key = "\"base_fy_n\": ";
  EXPECT_NEAR(std::stod(json.substr(json.find(key) + key.size())), -0.1, 1e-9);
  EXPECT_EQ(rows_of(read_text(out)).size(), 31u);
}

TEST(NeedleCommand, RefusesAndLeavesNothing) {
  const Scratch scratch;
  const std::string needle = (scratch / "needle.toml").string();
  write_text(needle, needle_text);
  write_text(scratch / "bare.toml", "[needle]\nmodel = \"beam\"\nlength_m = 0.1\n");
  write_text(scratch / "none.toml", "[contact]\nmethod = \"snap\"\n");
  write_text(scratch / "rigid.toml", shared_file("scenes/phantom.toml"));
  const std::string out = (scratch / "shape.csv").string();
  const auto refuses = [&](const std::string& file, const Words& more, const Words& words) {
    Words arguments{"needle", "bend", file, "--out", out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refusal(scratch, "trocar", arguments, words);
    for (const auto& entry : std::filesystem::directory_iterator(scratch.folder()))
      EXPECT_EQ(entry.path().filename().string().find("shape.csv"), std::string::npos) << entry.path();
  };
  refuses((scratch / "bare.toml").string(), {}, {"bare.toml", "needle.outer_m: missing", "gauge = \"22G\""});
  refuses((scratch / "rigid.toml").string(), {}, {"rigid.toml:18", "needle.model = \"rigid\"", "write \"beam\""});
  refuses((scratch / "none.toml").string(), {}, {"none.toml", "needle"});
  refuses(needle, {"--at", "0.2,0,1"}, {"--at 0.2,0,1", "from 0 to 0.15 m"});
  refuses(needle, {"--tip-force", "-3,0"}, {"unstable", "add a small lateral force"});
  refuses(needle, {"--tip-force", "1e300,0"}, {"not finite", "lower them"});
  const std::string thesis = (scratch / "thesis.toml").string();
  write_text(thesis, "[needle]\nmodel = \"thesis\"\ngauge = \"20G\"\nlength_m = 0.15\n");
  refuses(thesis, {"--tip-moment", "0.01"}, {"thesis.toml:2", "--tip-moment 0.01", "leave the moment out"});
  for (const char* force : {"0,1e9", "0,1e300"}) refuses(thesis, {"--tip-force", force}, {"thesis.toml:2", "% of the loads", "lower them"});
  write_text(scratch / "curved.toml", "[needle]\nmodel = \"thesis\"\ngauge = \"20G\"\nlength_m = 0.15\ncurvature_per_m = 2.0\n");
  refuses((scratch / "curved.toml").string(), {}, {"curved.toml:5", "needle.curvature_per_m = 2", "straight", "write model = \"beam\""});
  for (const Words& wrong : {Words{"--tip-force", "0"}, Words{"--tip-force", "0,nan"}, Words{"--at", "0.1,0"}, Words{"--at", "0.1,0,1,2"},
                             Words{"--tip-moment", "x"}}) {
    Words arguments{"needle", "bend", needle, "--out", out};
    arguments.insert(arguments.end(), wrong.begin(), wrong.end());
    Program program(scratch, "trocar", arguments);
    EXPECT_EQ(program.wait(answer_s), 2) << wrong[1];
    EXPECT_NE(program.errors().find(wrong[1]), std::string::npos) << program.errors();
  }
}

}  // namespace
}  // namespace trocar::testing
