#include "common/fem/gmsh.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <numeric>

#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using testing::message_of;

const std::filesystem::path meshes = TROCAR_TEST_DATA "/meshes";

std::string content(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

// A file of one's own, gone afterwards.
class Spoiled {
 public:
  explicit Spoiled(const std::string& text) : file_(::testing::TempDir() + "trocar_spoiled_" + std::to_string(::getpid()) + ".msh") {
    std::ofstream(file_, std::ios::binary) << text;
  }
  ~Spoiled() { std::filesystem::remove(file_); }
  Spoiled(const Spoiled&) = delete;
  Spoiled& operator=(const Spoiled&) = delete;
  [[nodiscard]] std::string refusal() const {
    return message_of([this] { (void)read_gmsh(file_); });
  }
  [[nodiscard]] Mesh read() const { return read_gmsh(file_); }

 private:
  std::filesystem::path file_;
};

std::string refusal(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return Spoiled(text.replace(at, from.size(), to)).refusal();
}

struct Kind {
  const char* name;
  Type type;
  double measure;  // area or volume, m^2 or m^3
};
class EachKindOfMesh : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(Gmsh, EachKindOfMesh,
                         ::testing::Values(Kind{"tri", Type::Tri3, 8e-4}, Kind{"quad", Type::Quad4, 8e-4}, Kind{"tet", Type::Tet4, 16e-6},
                                           Kind{"hex", Type::Hex8, 16e-6}),
                         [](const auto& one) { return std::string(one.param.name); });

// Stiffness against uniform expansion x -> x about the origin, bulk modulus 1: its energy measures the volume, by the kernels.
double measure(const Mesh& mesh) {
  Tissue tissue;
  tissue.model = mesh.dimension() == 3 ? Model::Solid : Model::PlaneStress;
  tissue.thickness_m = 1.0;
  tissue.zones = {{{1.0, 0.0}, {}, {}}};  // E = 1, nu = 0: energy density is d / 2
  const Eigen::SparseMatrix<double> k = assemble_stiffness(mesh, tissue);
  Eigen::VectorXd u(k.rows());
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    for (int a = 0; a < mesh.dimension(); ++a)
      u[static_cast<Eigen::Index>(n) * mesh.dimension() + a] = mesh.node[n][static_cast<std::size_t>(a)];
  return u.dot(k * u) / mesh.dimension();
}

TEST_P(EachKindOfMesh, EveryFormatGivesTheSameMesh) {
  const auto file = [](const char* format) { return meshes / (std::string(GetParam().name) + format); };
  const Mesh mesh = read_gmsh(file("_v4_ascii.msh"));
  EXPECT_EQ(mesh.type, GetParam().type);
  EXPECT_NEAR(measure(mesh), GetParam().measure, 1e-9 * GetParam().measure);
  for (const char* format : {"_v4_binary.msh", "_v2_ascii.msh", "_v2_binary.msh"}) {
    SCOPED_TRACE(format);
    const Mesh other = read_gmsh(file(format));
    EXPECT_EQ(other.type, mesh.type);
    EXPECT_EQ(other.element, mesh.element);
    EXPECT_EQ(other.region, mesh.region);
    EXPECT_EQ(other.region_name, mesh.region_name);
    EXPECT_EQ(other.group, mesh.group);
    ASSERT_EQ(other.node.size(), mesh.node.size());
    for (std::size_t n = 0; n < mesh.node.size(); ++n)
      for (std::size_t a = 0; a < 3; ++a) EXPECT_NEAR(other.node[n][a], mesh.node[n][a], 1e-15);
  }
}

TEST(Gmsh, NamesBecomeRegionsAndGroups) {
  const Mesh hex = read_gmsh(meshes / "hex_v4_binary.msh");
  EXPECT_EQ(hex.node.size(), 4u * 3 * 3);
  EXPECT_EQ(hex.element.size(), 3u * 2 * 2);
  EXPECT_EQ(hex.region_name, (std::vector<std::string>{"fat", "muscle"}));
  for (std::size_t e = 0; e < hex.element.size(); ++e) EXPECT_EQ(hex.region[e], hex.centroid(e)[2] < 0.01 ? 0 : 1);
  EXPECT_EQ(nodes_at(hex, std::string("floor")), nodes_at(hex, Side::ZMin));
  EXPECT_EQ(nodes_at(hex, std::string("9")), nodes_at(hex, Side::ZMax));
  EXPECT_EQ(nodes_at(hex, std::string("fat")).size(), 24u);
  const Mesh tri = read_gmsh(meshes / "tri_v2_ascii.msh");
  EXPECT_EQ(nodes_at(tri, std::string("held edge")), nodes_at(tri, Side::YMax));
  EXPECT_EQ(nodes_at(tri, std::string("5")), (std::vector<int>{0}));
  EXPECT_EQ(tri.region_name, std::vector<std::string>{"tissue"});
}

// The hexahedra of the file are those of a grid: the same answer, whatever the numbering.
TEST(Gmsh, AnswersAsTheSameGridDoes) {
  const Mesh mesh = read_gmsh(meshes / "hex_v2_ascii.msh");
  Tissue tissue;
  tissue.model = Model::Solid;
  tissue.zones = {{{2e4, 0.3}, {}, "fat"}, {{8e4, 0.4}, {}, "muscle"}};
  tissue.supports = {{std::string("floor"), {true, true, true}}};
  Tissue same = tissue;
  same.zones = {{{2e4, 0.3}, {}, {}}, {{8e4, 0.4}, Box{{-1, -1, 0.01}, {1, 1, 1}}, {}}};
  same.supports = {{Side::ZMin, {true, true, true}}};
  const Mesh grid = structured_grid(uniform_grid(Type::Hex8, {}, {0.04, 0.02, 0.02}, {4, 3, 3}));
  const auto push = [](const Mesh& m) {
    Eigen::VectorXd load = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * m.node.size()));
    const int n = Locator(m).nearest_node({0.04, 0.02, 0.02});
    load.segment<3>(3 * n) << 0.1, -0.2, 0.3;
    return std::pair{load, 3 * n};
  };
  const auto [load, at] = push(mesh);
  const auto [grid_load, grid_at] = push(grid);
  const Eigen::VectorXd u = Statics(mesh, tissue).solve(load);
  const Eigen::VectorXd expected = Statics(grid, same).solve(grid_load);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(u[at + a], expected[grid_at + a], 1e-8 * expected.cwiseAbs().maxCoeff());
}

constexpr const char* two_triangles = R"($MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
10 0 0 5
20 1 0 5
30 1 1 5
40 0 1 5
50 9 9 5
$EndNodes
$Elements
3
1 1 2 7 1 10 20
2 2 2 3 1 10 20 30
3 2 2 3 1 10 40 30
$EndElements
)";

TEST(Gmsh, TurnsElementsAndDropsNodesWithoutOne) {
  const Mesh mesh = Spoiled(two_triangles).read();
  EXPECT_EQ(mesh.node, (std::vector<Point>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}));
  EXPECT_EQ(mesh.element, (std::vector<std::array<int, 8>>{{0, 1, 2, -1, -1, -1, -1, -1}, {0, 2, 3, -1, -1, -1, -1, -1}}));
  EXPECT_EQ(mesh.region_name, std::vector<std::string>{"3"});
  EXPECT_EQ(mesh.group.at("7"), (std::vector<int>{0, 1}));
  EXPECT_EQ(mesh.group.at("3"), (std::vector<int>{0, 1, 2, 3}));
  // Windows line ends and an unknown section change nothing.
  std::string windows = std::string(two_triangles) + "$NodeData\n1\n\"name\"\n$EndNodeData\n";
  for (std::size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2) windows.insert(at, 1, '\r');
  EXPECT_EQ(Spoiled(windows).read().element, mesh.element);
}

TEST(Gmsh, TurnsBricksAndTetrahedra) {
  for (const char* name : {"hex_v2_ascii.msh", "tet_v2_ascii.msh", "quad_v2_ascii.msh"}) {
    const Mesh mesh = read_gmsh(meshes / name);
    std::string text = content(meshes / name);
    // Mirrored in x: every element comes with the other orientation.
    std::string mirrored = text;
    const std::size_t begin = mirrored.find("$Nodes\n") + 7;
    std::size_t line = mirrored.find('\n', begin) + 1;
    while (mirrored.compare(line, 9, "$EndNodes") != 0) {
      const std::size_t x = mirrored.find(' ', line) + 1;
      if (mirrored[x] == '-')
        mirrored.erase(x, 1);
      else
        mirrored.insert(x, 1, '-');
      line = mirrored.find('\n', line) + 1;
    }
    EXPECT_NEAR(measure(Spoiled(mirrored).read()), measure(mesh), 1e-12) << name;
  }
}

TEST(Gmsh, RefusesMeshesThatAreNotComputed) {
  EXPECT_NE(
      message_of([] { (void)read_gmsh(meshes / "quadratic.msh"); }).find("quadratic.msh: has quadratic triangles, which are not computed"),
      std::string::npos);
  EXPECT_NE(message_of([] { (void)read_gmsh(meshes / "mixed.msh"); }).find("mixed.msh: mixes triangles and quadrilaterals"),
            std::string::npos);
  EXPECT_NE(message_of([] { (void)read_gmsh(meshes / "version_1.msh"); }).find("version_1.msh:1: not a gmsh mesh"), std::string::npos);
  EXPECT_NE(message_of([] { (void)read_gmsh(meshes / "none.msh"); }).find("none.msh: there is no such file"), std::string::npos);
  EXPECT_NE(message_of([] { (void)read_gmsh(meshes); }).find("not a file"), std::string::npos);
  EXPECT_NE(Spoiled("").refusal().find("$MeshFormat is missing"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "2.2 0", "4 0").find(":2: format 4 is not read; save the mesh as version 4.1 or 2.2"),
            std::string::npos);
  EXPECT_NE(refusal(two_triangles, "30 1 1 5", "30 1 1 5.1").find("not flat: z reaches from 5.000000 to 5.100000"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "3 1 10 40 30", "3 1 10 40 60").find("node 60, which is not in the file"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "20 1 0 5", "10 1 0 5").find("two nodes have the number 10"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "20 1 0 5", "20 1 nan 5").find(":7: a coordinate is not a finite number"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "20 1 0 5", "20 1 zero 5").find(":7: expected a coordinate"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "2 2 2 3 1", "2 99 2 3 1").find("element type 99"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "3 2 2 3 1 10 40 30", "3 2 2 4 1 30 20 10")
                .find("the physical groups \"3\" and \"4\"; regions must not overlap"),
            std::string::npos);
  EXPECT_NE(refusal(two_triangles, "3 2 2 3 1 10 40 30", "3 2 2 3 1 30 20 10").find("two elements have the same nodes"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "5\n10", "500000000000\n10").find("do not fit in the rest of the file"), std::string::npos);
  EXPECT_NE(refusal(two_triangles, "$EndElements", "").find("expected $EndElements"), std::string::npos);
}

// Cut at any length, the file is refused, or is only short of what follows the elements.
TEST(Gmsh, RefusesFilesThatWereCutShort) {
  for (const auto& entry : std::filesystem::directory_iterator(meshes)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with("ary.msh") && !name.ends_with("ascii.msh")) continue;
    const std::string text = content(entry.path());
    for (std::size_t length = 0; length < text.find("$EndElements") + 11; length += 1 + length / 37) {
      const std::string said = Spoiled(text.substr(0, length)).refusal();
      EXPECT_NE(said, "") << name << " cut to " << length;
      EXPECT_EQ(said.find('\n'), std::string::npos);
    }
  }
}

// Whatever bytes are changed: a mesh or one Error, never anything else.
TEST(Gmsh, SurvivesDamage) {
  unsigned state = 3;
  const auto random = [&state](std::size_t below) {
    state = state * 1664525u + 1013904223u;
    return static_cast<std::size_t>(state >> 8) % below;
  };
  int refused = 0;
  for (const char* name : {"tri_v2_ascii.msh", "quad_v2_binary.msh", "tri_v4_ascii.msh", "quad_v4_binary.msh"}) {
    const std::string text = content(meshes / name);
    for (int i = 0; i < 500; ++i) {
      std::string damaged = text;
      for (int k = 0; k < 3; ++k) damaged[random(damaged.size())] = static_cast<char>(random(256));
      refused += Spoiled(damaged).refusal().empty() ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace trocar::fem
