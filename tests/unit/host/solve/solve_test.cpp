#include "host/solve/solve.hpp"

#include <cmath>
#include <sstream>
#include <vector>

#include "common/config/csv.hpp"
#include "file_fixture.hpp"

namespace trocar::host {
namespace {

using config::testing::expect_parts;

const std::atomic<bool> going{false};

// A bar of bricks along x, 100 x 10 x 10 mm, its left end sliding.
constexpr std::string_view bar = R"([tissue]
model = "solid"
grid = { size_m = [0.1, 0.01, 0.01], origin_m = [0, 0, 0], nodes = [6, 2, 2], element = "hex8" }
strain = "STRAIN"
[[tissue.material]]
young_pa = 1e4
poisson = 0.3
[[tissue.support]]
where = "x_min"
fix = ["x"]
[[tissue.support]]
where = "y_min"
fix = ["y"]
[[tissue.support]]
where = "z_min"
fix = ["z"]
)";
constexpr double area = 1e-4;

class SolveTest : public config::testing::FileFixture {
 protected:
  SolveOptions options(const std::string& scene, const std::string& loads) const {
    std::ofstream(folder_ / "scene.toml") << scene;
    std::ofstream(folder_ / "loads.csv") << loads;
    SolveOptions o;
    o.scene = folder_ / "scene.toml";
    o.loads = folder_ / "loads.csv";
    o.out = folder_ / "u.csv";
    o.vtu = folder_ / "u.vtu";
    return o;
  }
  static std::string bar_with(const std::string& strain) { return config::testing::edited(bar, "STRAIN", strain).text; }
  // Pulls the right end with `force_n` along x, a quarter on each corner.
  static std::string pull(double force_n) {
    std::ostringstream text;
    text << "x_m,y_m,z_m,fx_n,fy_n,fz_n\n";
    for (const char* y : {"0", "0.01"})
      for (const char* z : {"0", "0.01"}) text << "0.1," << y << ',' << z << ',' << 0.25 * force_n << ",0,0\n";
    return text.str();
  }
  double end_displacement() const {
    const config::Csv u = config::Csv::load(folder_ / "u.csv", {"node,x_m,y_m,z_m,ux_m,uy_m,uz_m"});
    EXPECT_EQ(u.rows(), 24u);
    EXPECT_EQ(u(5, 1), 0.1);
    return u(5, 4);
  }
};

TEST_F(SolveTest, StretchesABarAsHookeSays) {
  const SolveSummary s = run_solve(options(bar_with("linear"), pull(0.01)), going);
  const double strain = 0.01 / area / 1e4;
  EXPECT_NEAR(end_displacement(), 0.1 * strain, 1e-14);
  EXPECT_NEAR(s.reaction_n[0], -0.01, 1e-14);
  EXPECT_NEAR(s.load_n[0], 0.01, 1e-16);
  EXPECT_NEAR(s.energy_j, 0.5 * 0.01 * 0.1 * strain, 1e-16);
  EXPECT_EQ(s.loaded_nodes, 4u);
  EXPECT_LT(s.residual_n, 1e-14);
  EXPECT_GT(std::filesystem::file_size(folder_ / "u.vtu"), 24u * 7 * 8);
  EXPECT_EQ(to_json(s).front(), '{');
}

// St. Venant-Kirchhoff in uniaxial stress: force = area * lambda * E_young * (lambda^2 - 1) / 2.
TEST_F(SolveTest, StretchesABarAsGreenLagrangeStrainSays) {
  const double lambda = 1.2;
  const double force = area * lambda * 1e4 * 0.5 * (lambda * lambda - 1.0);
  const SolveSummary s = run_solve(options(bar_with("green_lagrange"), pull(force)), going);
  EXPECT_NEAR(end_displacement(), 0.1 * (lambda - 1.0), 1e-9);
  EXPECT_NEAR(s.reaction_n[0], -force, 1e-9 * force);
  EXPECT_GT(s.iterations, 1);
  EXPECT_LT(s.residual_n, 1e-9 * force);
}

// Beyond the largest compressive force of that material, at lambda = 1 / sqrt(3), there is no equilibrium near by.
TEST_F(SolveTest, SaysWhenThereIsNoEquilibrium) {
  const double lambda = 1.0 / std::sqrt(3.0);
  const double most = area * lambda * 1e4 * 0.5 * (lambda * lambda - 1.0);
  const SolveOptions o = options(bar_with("green_lagrange"), pull(1.5 * most));
  expect_parts(error_from([&] { (void)run_solve(o, going); }), {"scene.toml: no equilibrium beyond", "of the loads"});
  EXPECT_FALSE(std::filesystem::exists(o.out));
  EXPECT_FALSE(std::filesystem::exists(o.vtu));
}

TEST_F(SolveTest, SolvesOnAGmshMesh) {
  std::string scene =
      config::testing::edited(bar_with("linear"),
                              "grid = { size_m = [0.1, 0.01, 0.01], origin_m = [0, 0, 0], nodes = [6, 2, 2], element = \"hex8\" }",
                              "file = \"block.msh\"")
          .text;
  std::filesystem::copy_file(TROCAR_TEST_DATA "/meshes/hex_v4_binary.msh", folder_ / "block.msh");
  const std::string loads = "x_m,y_m,z_m,fx_n,fy_n,fz_n\n0.04,0.02,0.02,0.1,0,0\n";
  EXPECT_EQ(run_solve(options(scene, loads), going).nodes, 36u);
  scene = config::testing::edited(scene, "where = \"z_min\"", "where = \"floor\"").text;
  const SolveSummary s = run_solve(options(scene, loads), going);
  EXPECT_NEAR(s.reaction_n[0], -0.1, 1e-12);
  expect_parts(error_from([&] { (void)run_solve(options(config::testing::edited(scene, "\"floor\"", "\"ceiling\"").text, loads), going); }),
               {"scene.toml: the mesh has no group \"ceiling\"", "\"floor\""});
}

TEST_F(SolveTest, LeavesNothingWhenItCannot) {
  const auto refused = [&](const SolveOptions& o, std::initializer_list<std::string> parts) {
    expect_parts(error_from([&] { (void)run_solve(o, going); }), parts);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "u.csv"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "u.vtu"));
    EXPECT_LE(std::distance(std::filesystem::directory_iterator(folder_), {}), 2);
  };
  refused(options(bar_with("linear"), "x_m,y_m,z_m,fx_n,fy_n,fz_n\n0,0.005,0,1,0,0\n"), {"loads.csv:2:", "is not a node"});
  refused(options(bar_with("wavy"), pull(1)), {"scene.toml:4: tissue.strain"});
  std::string loose = config::testing::edited(bar_with("linear"), "where = \"y_min\"", "box = [[0, 0, 0], [0, 0, 0]]").text;
  loose = config::testing::edited(loose, "where = \"z_min\"", "box = [[0, 0, 0], [0, 0, 0]]").text;
  refused(options(loose, pull(1)), {"scene.toml: the mesh is unsupported: it can still rotate about x as a rigid body"});
  SolveOptions elsewhere = options(bar_with("linear"), pull(1));
  elsewhere.out = folder_ / "none" / "u.csv";
  refused(elsewhere, {"none/u.csv: cannot be written"});
  const std::atomic<bool> stopped{true};
  expect_parts(error_from([&] { (void)run_solve(options(bar_with("linear"), pull(1)), stopped); }), {"stopped; nothing was written"});
}

}  // namespace
}  // namespace trocar::host
