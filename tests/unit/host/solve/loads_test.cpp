#include "host/solve/loads.hpp"

#include "file_fixture.hpp"

namespace trocar::host {
namespace {

using config::testing::expect_parts;

class LoadsTest : public config::testing::FileFixture {
 protected:
  const fem::Mesh plane_ = fem::structured_grid(fem::uniform_grid(fem::Type::Quad4, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {4, 4, 1}));
  const fem::Mesh solid_ = fem::structured_grid(fem::uniform_grid(fem::Type::Hex8, {}, {0.1, 0.1, 0.1}, {2, 2, 2}));
  void refused(const fem::Mesh& mesh, std::string_view text, std::initializer_list<std::string> parts) const {
    expect_parts(error_of(text, [&](const auto& file) { return read_loads(file, mesh); }), parts);
  }
};

TEST_F(LoadsTest, AddsUpOnTheNodes) {
  const Loads loads = read_loads(write("x_m,y_m,fx_n,fy_n\n-0.05,0,1,2\n0.05,0.1,0,-1\n-0.05,0,0.5,0\n"), plane_);
  EXPECT_EQ(loads.rows, 3u);
  EXPECT_EQ(loads.nodes, 2u);
  EXPECT_EQ(loads.force_n[0], 1.5);
  EXPECT_EQ(loads.force_n[1], 2.0);
  EXPECT_EQ(loads.force_n[31], -1.0);
  EXPECT_EQ(loads.force_n.cwiseAbs().sum(), 4.5);
  const Loads cube = read_loads(write("x_m,y_m,z_m,fx_n,fy_n,fz_n\n0.1,0,0.1,1,2,3\n"), solid_);
  EXPECT_EQ(cube.force_n.segment<3>(15), Eigen::Vector3d(1, 2, 3));
}

TEST_F(LoadsTest, TakesRoundedCoordinatesUpToANanometre) {
  EXPECT_EQ(read_loads(write("x_m,y_m,fx_n,fy_n\n-0.0166666667,0.0333333333,1,0\n"), plane_).force_n[10], 1.0);
  refused(plane_, "x_m,y_m,fx_n,fy_n\n-0.016667,0.033333,1,0\n",
          {"file.toml:2: (-0.016667, 0.033333) m is not a node; the nearest is node 5 at (-0.01666"});
}

TEST_F(LoadsTest, NamesTheNearestNode) {
  refused(plane_, "x_m,y_m,fx_n,fy_n\n\n0.049,0.1,1,0\n",
          {"file.toml:3:", "(0.049, 0.1) m is not a node; the nearest is node 15 at (0.05, 0.1) m, 0.001 m away"});
  refused(solid_, "x_m,y_m,z_m,fx_n,fy_n,fz_n\n0,0.1,0.3,1,0,0\n", {"file.toml:2:", "node 6 at (0, 0.1, 0.1) m, 0.2 m away"});
}

TEST_F(LoadsTest, RefusesTheOtherDimension) {
  refused(plane_, "x_m,y_m,z_m,fx_n,fy_n,fz_n\n0,0,0,1,0,0\n", {"file.toml:1:", "write x_m,y_m,fx_n,fy_n"});
  refused(solid_, "x_m,y_m,fx_n,fy_n\n0,0,1,0\n", {"file.toml:1:", "write x_m,y_m,z_m,fx_n,fy_n,fz_n"});
}

}  // namespace
}  // namespace trocar::host
