#include "common/config/scene_file.hpp"

#include "file_fixture.hpp"

namespace trocar::config {
namespace {

using testing::edited;
using testing::expect_parts;

constexpr std::string_view scene_text = R"([tissue]
model = "plane_stress"
thickness_m = 0.011
grid = { size_m = [0.1, 0.12], origin_m = [-0.05, 0.15], nodes = [21, 25], element = "quad4" }
[[tissue.material]]
young_pa = 25300.0
poisson = 0.48
[[tissue.material]]
young_pa = 63000.0
poisson = 0.49
box = [[0.05, 0.2], [-0.05, 0.15]]
[[tissue.support]]
where = "y_max"
fix = ["x", "y"]
[[tissue.support]]
box = [[-0.05, 0.15], [-0.04, 0.16]]
fix = ["x"]
[needle]
model = "rigid"
length_m = 0.1
[contact]
method = "embedded"
shaft_n_per_m = 34.0
tip_n_per_m = 68.0
tip_zone_m = 0.0025
velocity_law = "ours"
[[velocity_law]]
name = "ours"
speed_m_s = [0.001, 0.005, 0.009]
shaft_n_per_m = [34.0, 50.0, 60.0]
tip_n_per_m = [68.0, 60.0, 61.0]
)";

class SceneFileTest : public testing::FileFixture {
 protected:
  void refused(std::string_view from, std::string_view to, std::initializer_list<std::string> parts) {
    const auto spoiled = edited(scene_text, from, to);
    const std::string message = error_of(spoiled.text, read_scene);
    expect_parts(message, {spoiled.line});
    expect_parts(message, parts);
  }
};

TEST_F(SceneFileTest, FillsEveryMemberFromTheFile) {
  const SceneFile scene = read_scene(write(scene_text));
  EXPECT_EQ(scene.tissue.model, TissueModel::PlaneStress);
  EXPECT_EQ(scene.tissue.thickness_m, 0.011);
  EXPECT_EQ(scene.tissue.grid.size_m, (std::array{0.1, 0.12}));
  EXPECT_EQ(scene.tissue.grid.origin_m, (std::array{-0.05, 0.15}));
  EXPECT_EQ(scene.tissue.grid.nodes, (std::array{21, 25}));
  EXPECT_EQ(scene.tissue.grid.element, GridElement::Quad4);
  ASSERT_EQ(scene.tissue.materials.size(), 2u);
  EXPECT_EQ(scene.tissue.materials[0].young_pa, 25300.0);
  EXPECT_EQ(scene.tissue.materials[0].poisson, 0.48);
  EXPECT_FALSE(scene.tissue.materials[0].box.has_value());
  ASSERT_TRUE(scene.tissue.materials[1].box.has_value());
  EXPECT_EQ(scene.tissue.materials[1].box->min_m, (std::array{-0.05, 0.15}));
  EXPECT_EQ(scene.tissue.materials[1].box->max_m, (std::array{0.05, 0.2}));
  ASSERT_EQ(scene.tissue.supports.size(), 2u);
  EXPECT_EQ(scene.tissue.supports[0].edge, GridEdge::YMax);
  EXPECT_TRUE(scene.tissue.supports[0].fix_x && scene.tissue.supports[0].fix_y);
  ASSERT_TRUE(scene.tissue.supports[1].box.has_value());
  EXPECT_TRUE(scene.tissue.supports[1].fix_x && !scene.tissue.supports[1].fix_y);
  EXPECT_EQ(scene.needle.length_m, 0.1);
  EXPECT_EQ(scene.contact.shaft_n_per_m, 34.0);
  EXPECT_EQ(scene.contact.tip_n_per_m, 68.0);
  EXPECT_EQ(scene.contact.tip_zone_m, 0.0025);
  ASSERT_TRUE(scene.contact.velocity_law.has_value());
  EXPECT_EQ(scene.contact.velocity_law->name, "ours");
  EXPECT_EQ(scene.contact.velocity_law->speed_m_s, (std::vector{0.001, 0.005, 0.009}));
  EXPECT_EQ(scene.contact.velocity_law->shaft_n_per_m, (std::vector{34.0, 50.0, 60.0}));
  EXPECT_EQ(scene.contact.velocity_law->tip_n_per_m, (std::vector{68.0, 60.0, 61.0}));
}

TEST_F(SceneFileTest, ReadsEverySceneThatIsShipped) {
  std::size_t read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TROCAR_SHARE "/scenes")) {
    if (entry.path().extension() != ".toml") continue;
    EXPECT_NO_THROW(static_cast<void>(read_scene(entry.path())));
    ++read;
  }
  EXPECT_GE(read, 1u);
}

TEST_F(SceneFileTest, LeavesTheVelocityLawOutWhenNoneIsNamed) {
  EXPECT_FALSE(read_scene(write(edited(scene_text, "velocity_law = \"ours\"\n", "velocity_law = \"none\"\n").text))
                   .contact.velocity_law.has_value());
  EXPECT_FALSE(read_scene(write(edited(scene_text, "velocity_law = \"ours\"\n", "").text)).contact.velocity_law.has_value());
}

TEST_F(SceneFileTest, NeedsDensitiesOnlyWithoutAVelocityLaw) {
  const auto text = edited(scene_text, "shaft_n_per_m = 34.0\n", "").text;
  EXPECT_EQ(read_scene(write(text)).contact.shaft_n_per_m, 34.0);
  expect_parts(error_of(edited(text, "velocity_law = \"ours\"\n", "").text, read_scene),
               {"file.toml:21: contact.shaft_n_per_m: missing in [contact]"});
}

TEST_F(SceneFileTest, SaysWhatIsNotAvailableYet) {
  refused("model = \"plane_stress\"", "model = \"solid\"",
          {"tissue.model = \"solid\": not available yet; write \"plane_stress\" or \"plane_strain\""});
  refused("model = \"plane_stress\"", "file = \"lung.msh\"",
          {"tissue.file = \"lung.msh\": not available yet; describe the tissue with grid"});
  refused("model = \"rigid\"", "model = \"beam\"", {"needle.model = \"beam\": not available yet; write \"rigid\""});
  refused("length_m = 0.1\n", "gauge = \"22G\"\n", {"needle.gauge = \"22G\": not available yet"});
  refused("method = \"embedded\"", "method = \"snap\"", {"contact.method = \"snap\": not available yet; write \"embedded\""});
  refused("method = \"embedded\"", "points_m = [[0, 0]]", {"contact.points_m = [[0, 0]]: not available yet"});
  refused("poisson = 0.48", "region = \"lung\"", {"tissue.material.region = \"lung\": not available yet; use box"});
  const auto spacing = edited(scene_text, "nodes = [21, 25],", "nodes = [21, 25], spacing = [[0.1], [0.1]],");
  expect_parts(error_of(spacing.text, read_scene), {"file.toml:4: tissue.grid.spacing", "not available yet"});
}

TEST_F(SceneFileTest, RefusesWhatCannotBeComputed) {
  refused("poisson = 0.48", "poisson = 0.5", {"tissue.material.poisson = 0.5: must be from 0 to 0.4999"});
  refused("young_pa = 25300.0", "young_kpa = 25.3",
          {"tissue.material.young_kpa = 25.3: unknown key; moduli are in pascals: write young_pa = 25300 for 25.3 kPa"});
  refused("thickness_m = 0.011", "thickness_m = 11", {"tissue.thickness_m = 11", "if that is 11 mm, write 0.011"});
  refused("where = \"y_max\"", "where = \"top\"", {"tissue.support.where = \"top\": not known here", "\"y_max\""});
  refused("where = \"y_max\"", "where = \"y_max\"\nbox = [[0, 0], [1, 1]]", {"either where or box"});
  refused("fix = [\"x\", \"y\"]", "fix = [\"z\"]", {"tissue.support.fix = [\"z\"]: \"z\" is not known here; choose from \"x\", \"y\""});
  refused("tip_zone_m = 0.0025", "tip_zone_m = 0.1", {"contact.tip_zone_m = 0.1: not shorter than the needle (0.1 m)"});
  const auto held = edited(scene_text, "fix = [\"x\", \"y\"]", "fix = [\"x\"]");
  expect_parts(error_of(held.text, read_scene), {"file.toml:12: tissue.support: nothing holds the tissue along y", "where = \"y_max\""});
  std::string bare(scene_text);
  bare.erase(bare.find("[[tissue.material]]"), bare.find("[[tissue.support]]") - bare.find("[[tissue.material]]"));
  expect_parts(error_of(bare, read_scene), {"tissue.material: missing; add one [[tissue.material]]"});
  expect_parts(error_of(edited(scene_text, "poisson = 0.48\n", "poisson = 0.48\nbox = [[0, 0], [1, 1]]\n").text, read_scene),
               {"the first one must hold everywhere"});
}

TEST_F(SceneFileTest, RefusesVelocityLawsThatDoNotFit) {
  refused("velocity_law = \"ours\"", "velocity_law = \"theirs\"",
          {"contact.velocity_law = \"theirs\": no [[velocity_law]] of this file", "\"none\", \"ours\""});
  refused("speed_m_s = [0.001, 0.005, 0.009]", "speed_m_s = [0.005, 0.001, 0.009]", {"velocity_law.speed_m_s", "must increase"});
  refused("tip_n_per_m = [68.0, 60.0, 61.0]", "tip_n_per_m = [68.0, 60.0]",
          {"velocity_law.tip_n_per_m = [68, 60]: 2 entries for 3 speeds"});
  refused("speed_m_s = [0.001, 0.005, 0.009]", "speed_mm_s = [1, 5, 9]",
          {"speeds are in metres per second: write speed_m_s = [0.001, 0.005, 0.009]"});
}

}  // namespace
}  // namespace trocar::config
