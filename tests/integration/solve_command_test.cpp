// `trocar solve` as a person types it: results, summary, exit codes, and what it leaves behind.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iterator>
#include <sstream>

#include "harness.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

constexpr const char* loads_text = "x_m,y_m,fx_n,fy_n\n0,0.215,0,0.3\n";

struct Place {
  Scratch scratch;
  std::string loads = (scratch / "loads.csv").string();
  std::string out = (scratch / "u.csv").string();
  std::string vtu = (scratch / "u.vtu").string();
  Place() { write_text(loads, loads_text); }
  [[nodiscard]] std::string scene(const Edits& edits) const {
    write_text(scratch / "scene.toml", shared_file("scenes/phantom.toml", edits));
    return (scratch / "scene.toml").string();
  }
  // Nothing is there that was not before: no result, no part of one.
  void expect_untouched() const {
    for (const auto& entry : std::filesystem::directory_iterator(scratch.folder())) {
      const std::string name = entry.path().filename().string();
      EXPECT_TRUE(name.find("u.csv") == std::string::npos && name.find("u.vtu") == std::string::npos) << name;
    }
  }
};

// Field `column` of the row that begins with `node,`.
double value(const std::string& table, const std::string& node, int column) {
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(node + ",", 0) != 0) continue;
    std::istringstream fields(line);
    std::string field;
    for (int i = 0; i <= column; ++i) std::getline(fields, field, ',');
    return std::strtod(field.c_str(), nullptr);
  }
  ADD_FAILURE() << "no node " << node;
  return 0.0;
}

TEST(SolveCommand, WritesDisplacementsAndFields) {
  const Place place;
  Program program(place.scratch, "trocar", {"solve", "phantom", "--loads", place.loads, "--out", place.out, "--vtu", place.vtu});
  ASSERT_EQ(program.wait(answer_s), 0) << program.errors();
  EXPECT_EQ(program.errors(), "");
  EXPECT_NE(program.out().find("441 nodes, 400 elements, 1 loaded nodes; largest displacement"), std::string::npos) << program.out();
  const std::string table = read_text(place.out);
  EXPECT_EQ(table.rfind("node,x_m,y_m,ux_m,uy_m\n", 0), 0U);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 442);
  EXPECT_EQ(value(table, "10", 1), 0.0);
  EXPECT_EQ(value(table, "10", 2), 0.215);
  EXPECT_GT(value(table, "10", 4), 1e-3);  // 0.3 N on a soft block: millimetres, straight in
  EXPECT_LT(std::abs(value(table, "10", 3)), 1e-12);
  EXPECT_EQ(value(table, "430", 4), 0.0);  // the far face is held
  EXPECT_NE(read_text(place.vtu).find("<VTKFile type=\"UnstructuredGrid\""), std::string::npos);
}

TEST(SolveCommand, RepeatsTheSameBytesAndSaysItInJson) {
  const Place place;
  const auto run = [&](const std::string& out) {
    Program program(place.scratch, "trocar",
                    {"solve", "phantom", "--loads", place.loads, "--out", (place.scratch / out).string(), "--json"});
    EXPECT_EQ(program.wait(answer_s), 0) << program.errors();
    const std::string said = program.out();
    EXPECT_EQ(said.rfind("{\"nodes\": 441, ", 0), 0U) << said;
    EXPECT_TRUE(said.ends_with("}\n")) << said;
    EXPECT_NE(said.find("\"largest_displacement\": {\"node\": 10, "), std::string::npos) << said;
    return read_text(place.scratch / out);
  };
  EXPECT_EQ(run("a.csv"), run("b.csv"));
}

TEST(SolveCommand, NeedsNeitherNeedleNorContactAndTakesAnyNeedle) {
  const Place place;
  std::string text = shared_file("scenes/phantom.toml");
  for (const std::string& rest :
       {std::string(), std::string("[needle]\ngauge = \"22G\"\nlength_m = 0.10\nmodel = \"beam\"\nelements = 24\n"),
        std::string("[needle]\nmodel = \"thesis\"\nlength_m = 0.15\nouter_m = 9e-4\ninner_m = 6e-4\nyoung_pa = 9.8e8\n")}) {
    write_text(place.scratch / "scene.toml", text.substr(0, text.find("[needle]")) + rest);
    Program program(place.scratch, "trocar",
                    {"solve", (place.scratch / "scene.toml").string(), "--loads", place.loads, "--out", place.out});
    EXPECT_EQ(program.wait(answer_s), 0) << program.errors();
  }
}

TEST(SolveCommand, RefusesWhatItCannotSolve) {
  const Place place;
  const auto refused = [&](const std::string& scene, const Words& words) {
    expect_refusal(place.scratch, "trocar", {"solve", scene, "--loads", place.loads, "--out", place.out, "--vtu", place.vtu}, words);
    place.expect_untouched();
  };
  refused("phantoom", {"phantoom", "did you mean phantom?"});
  refused(place.scene({{"poisson = 0.48", "poisson = 0.5"}}), {"scene.toml:11", "tissue.material.poisson = 0.5"});
  refused(place.scene({{"fix = [\"x\", \"y\"]", "fix = [\"y\"]"}}), {"scene.toml", "nothing holds the tissue along x"});
  refused(place.scene({{"where = \"y_max\"\nfix = [\"x\", \"y\"]", "box = [[0, 0.315], [0, 0.315]]\nfix = [\"x\", \"y\"]"}}),
          {"scene.toml: the mesh is unsupported: it can still rotate"});
  refused(place.scene({{"grid = { size_m = [0.1, 0.1], origin_m = [-0.05, 0.215], nodes = [21, 21], element = \"quad4\" }",
                        "file = \"none.msh\""}}),
          {"none.msh: there is no such file"});
  write_text(place.scratch / "bad.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 10 1");
  refused(place.scene(
              {{"grid = { size_m = [0.1, 0.1], origin_m = [-0.05, 0.215], nodes = [21, 21], element = \"quad4\" }", "file = \"bad.msh\""}}),
          {"bad.msh:5: ", "cut short"});

  write_text(place.loads, "x_m,y_m,fx_n,fy_n\n0.001,0.215,0,1\n");
  refused("phantom", {"loads.csv:2: (0.001, 0.215) m is not a node; the nearest is node 10 at (0, 0.215) m"});
  write_text(place.loads, "x_mm,y_mm,fx_n,fy_n\n0,215,0,1\n");
  refused("phantom", {"loads.csv:1:", "write x_m,y_m,fx_n,fy_n"});
  write_text(place.loads, "x_m,y_m,fx_n,fy_n\n0,0.215,0,much\n");
  refused("phantom", {"loads.csv:2: fy_n = \"much\": not a number"});
  place.expect_untouched();
  expect_refusal(place.scratch, "trocar", {"solve", "phantom", "--loads", place.out, "--out", place.out}, {"u.csv: there is no such file"});
  write_text(place.loads, loads_text);
  const std::string nowhere = (place.scratch / "none" / "u.csv").string();
  expect_refusal(place.scratch, "trocar", {"solve", "phantom", "--loads", place.loads, "--out", nowhere}, {nowhere, "cannot be written"});
}

TEST(SolveCommand, WrongUsageIsCodeTwoAndHelpShowsAnExample) {
  const Place place;
  const auto code = [&](const Words& arguments) {
    Program program(place.scratch, "trocar", arguments);
    return program.wait(answer_s);
  };
  EXPECT_EQ(code({"solve"}), 2);
  EXPECT_EQ(code({"solve", "phantom", "--out", place.out}), 2);
  EXPECT_EQ(code({"solve", "phantom", "--loads", place.loads}), 2);
  EXPECT_EQ(code({"solve", "phantom", "--loads", place.loads, "--out", place.out, "--dance"}), 2);
  place.expect_untouched();
  Program help(place.scratch, "trocar", {"solve", "--help"});
  EXPECT_EQ(help.wait(answer_s), 0);
  EXPECT_NE(help.out().find("Example: trocar solve phantom --loads"), std::string::npos);
}

}  // namespace
}  // namespace trocar::testing
