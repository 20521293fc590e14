#include "common/scene/scene.hpp"

#include "file_fixture.hpp"

namespace trocar::scene {
namespace {

using config::UserError;
using config::testing::edited;
using config::testing::expect_parts;

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

class SceneTest : public config::testing::FileFixture {
 protected:
  void refused(std::string_view from, std::string_view to, std::initializer_list<std::string> parts) {
    const auto spoiled = edited(scene_text, from, to);
    const std::string message = error_of(spoiled.text, read_scene);
    expect_parts(message, {spoiled.line});
    expect_parts(message, parts);
  }
};

TEST_F(SceneTest, FillsEveryMemberFromTheFile) {
  const Scene scene = read_scene(write(scene_text));
  EXPECT_EQ(scene.tissue.model, fem::Model::PlaneStress);
  EXPECT_EQ(scene.tissue.integration, fem::Integration::Full);
  EXPECT_EQ(scene.tissue.strain, fem::Strain::Linear);
  EXPECT_EQ(scene.tissue.thickness_m, 0.011);
  ASSERT_TRUE(scene.tissue.grid.has_value());
  EXPECT_EQ(scene.tissue.grid->element, fem::Type::Quad4);
  EXPECT_EQ(scene.tissue.grid->axis_m[0].size(), 21u);
  EXPECT_EQ(scene.tissue.grid->axis_m[0].front(), -0.05);
  EXPECT_EQ(scene.tissue.grid->axis_m[0].back(), 0.05);
  EXPECT_EQ(scene.tissue.grid->axis_m[1].size(), 25u);
  EXPECT_EQ(scene.tissue.grid->axis_m[1].front(), 0.15);
  EXPECT_TRUE(scene.tissue.grid->axis_m[2].empty());
  ASSERT_EQ(scene.tissue.zones.size(), 2u);
  EXPECT_EQ(scene.tissue.zones[0].material.young_pa, 25300.0);
  EXPECT_EQ(scene.tissue.zones[0].material.poisson, 0.48);
  EXPECT_FALSE(scene.tissue.zones[0].box.has_value());
  ASSERT_TRUE(scene.tissue.zones[1].box.has_value());
  EXPECT_EQ(*scene.tissue.zones[1].box, (fem::Box{{-0.05, 0.15, -fem::Box::far}, {0.05, 0.2, fem::Box::far}}));
  ASSERT_EQ(scene.tissue.supports.size(), 2u);
  EXPECT_EQ(scene.tissue.supports[0].where, fem::Where(fem::Side::YMax));
  EXPECT_EQ(scene.tissue.supports[0].fix, (std::array{true, true, false}));
  EXPECT_EQ(scene.tissue.supports[1].where.kind, fem::Where::Kind::Box);
  EXPECT_EQ(scene.tissue.supports[1].fix, (std::array{true, false, false}));
  ASSERT_TRUE(scene.needle.has_value());
  EXPECT_EQ(scene.needle->model, NeedleModel::Rigid);
  EXPECT_EQ(scene.needle->length_m, 0.1);
  EXPECT_FALSE(scene.needle->outer_m.has_value());
  ASSERT_TRUE(scene.contact.has_value());
  EXPECT_EQ(scene.contact->method, contact::Method::Embedded);
  EXPECT_EQ(scene.contact->shaft_n_per_m, 34.0);
  EXPECT_EQ(scene.contact->tip_n_per_m, 68.0);
  EXPECT_EQ(scene.contact->tip_zone_m, 0.0025);
  EXPECT_EQ(scene.contact->spacing_m, 0.0);
  EXPECT_EQ(scene.contact->explicit_count, 0u);
  EXPECT_EQ(scene.velocity_law, "ours");
  ASSERT_EQ(scene.contact->velocity.rows, 3u);
  EXPECT_EQ(scene.contact->velocity.speed_m_s[1], 0.005);
  EXPECT_EQ(scene.contact->velocity.shaft_n_per_m[2], 60.0);
  EXPECT_EQ(scene.contact->velocity.tip_n_per_m[0], 68.0);
  EXPECT_FALSE(scene.corridor.has_value());
  EXPECT_EQ(scene.visible, fem::Where(fem::Box{}));
  EXPECT_FALSE(scene.single_precision);
  EXPECT_NO_THROW(require_insertion(scene));
  EXPECT_NEAR(entry_m(scene)[0], 0.0, 1e-15);
  EXPECT_EQ(entry_m(scene)[1], 0.15);
}

constexpr std::string_view solid_text = R"([tissue]
model = "solid"
integration = "bbar"
strain = "green_lagrange"
grid = { size_m = [0.04, 0.1, 0.011], origin_m = [-0.02, 0.0, 0.0], nodes = [9, 11, 4], element = "hex8", spacing = [{ towards_m = 0.0, smallest_m = 0.001 }, "uniform", { towards_m = 0.011, ratio = 1.5 }] }
[[tissue.material]]
young_pa = 25300.0
poisson = 0.4999
box = [[-1, -1, -1], [1, 1, 1]]
[[tissue.support]]
where = "z_min"
fix = ["x", "y", "z"]
[needle]
model = "beam"
gauge = "22G"
length_m = 0.10
elements = 30
[contact]
method = "adapt"
shaft_n_per_m = 34.0
tip_n_per_m = 68.0
tip_zone_m = 0.0025
spacing_m = 0.004
corridor = { from_m = [0.0, 0.0], to_m = [0.0, 0.1], half_width_m = 0.015 }
plane_z_m = 0.006
visible = "x_max"
storage = "float32"
)";

TEST_F(SceneTest, ReadsASolidWithEverything) {
  const Scene scene = read_scene(write(solid_text));
  EXPECT_EQ(scene.tissue.model, fem::Model::Solid);
  EXPECT_EQ(scene.tissue.integration, fem::Integration::BBar);
  EXPECT_EQ(scene.tissue.strain, fem::Strain::GreenLagrange);
  const auto& axis = scene.tissue.grid->axis_m;
  ASSERT_EQ(axis[0].size(), 9u);
  EXPECT_EQ(axis[0][4], 0.0);
  EXPECT_NEAR(axis[0][5], 0.001, 1e-12);
  EXPECT_NEAR(axis[1][1], 0.01, 1e-15);
  ASSERT_EQ(axis[2].size(), 4u);
  EXPECT_NEAR((axis[2][1] - axis[2][0]) / (axis[2][2] - axis[2][1]), 1.5, 1e-9);
  EXPECT_EQ(scene.tissue.zones[0].box->min_m[2], -1.0);
  EXPECT_EQ(scene.tissue.supports[0].fix, (std::array{true, true, true}));
  EXPECT_EQ(scene.needle->model, NeedleModel::Beam);
  EXPECT_EQ(scene.needle->outer_m, 0.718e-3);
  EXPECT_EQ(scene.needle->inner_m, 0.413e-3);
  EXPECT_EQ(scene.needle->young_pa, 200e9);
  EXPECT_EQ(scene.needle->elements, 30);
  EXPECT_EQ(scene.contact->method, contact::Method::Adapt);
  EXPECT_EQ(scene.contact->spacing_m, 0.004);
  ASSERT_TRUE(scene.corridor.has_value());
  EXPECT_EQ(scene.corridor->to_m, (std::array{0.0, 0.1}));
  EXPECT_EQ(scene.corridor->half_width_m, 0.015);
  EXPECT_EQ(scene.plane_z_m, 0.006);
  EXPECT_EQ(scene.visible, fem::Where(fem::Side::XMax));
  EXPECT_TRUE(scene.single_precision);
  EXPECT_NO_THROW(require_insertion(scene));
}

TEST_F(SceneTest, NeedsNeitherNeedleNorContact) {
  const std::string text(scene_text.substr(0, scene_text.find("[needle]")));
  const Scene scene = read_scene(write(text));
  EXPECT_FALSE(scene.needle.has_value());
  EXPECT_FALSE(scene.contact.has_value());
  expect_parts(error_from([&] { require_insertion(scene); }), {"file.toml: needle: missing"});
  const Scene needle =
      read_scene(write(text + "[needle]\nmodel = \"thesis\"\nlength_m = 0.15\nouter_m = 0.0009\ninner_m = 0.0006\nyoung_pa = 2e11\n"));
  EXPECT_EQ(needle.needle->model, NeedleModel::Thesis);
  expect_parts(error_from([&] { require_insertion(needle); }), {"file.toml:", "needle.model = \"thesis\"", "write \"beam\""});
  EXPECT_EQ(needle.needle->elements, 15);  // 16 nodes along the needle, as printed
  EXPECT_EQ(needle.needle->inner_m, 0.0006);
}

TEST_F(SceneTest, TakesNodeCoordinatesAsTheyStand) {
  const Scene scene = read_scene(write(
      edited(scene_text, "size_m = [0.1, 0.12], origin_m = [-0.05, 0.15], nodes = [21, 25]", "x_m = [-0.01, 0.0, 0.02], y_m = [0, 0.5]")
          .text));
  EXPECT_EQ(scene.tissue.grid->axis_m[0], (std::vector{-0.01, 0.0, 0.02}));
  EXPECT_EQ(scene.tissue.grid->axis_m[1], (std::vector{0.0, 0.5}));
}

TEST_F(SceneTest, TakesMeshFilesBesideTheScene) {
  std::string text = edited(scene_text, "grid = { size_m = [0.1, 0.12], origin_m = [-0.05, 0.15], nodes = [21, 25], element = \"quad4\" }",
                            "file = \"meshes/lung.msh\"")
                         .text;
  text = edited(text, "box = [[0.05, 0.2], [-0.05, 0.15]]", "region = \"tumour\"").text;
  text = edited(text, "where = \"y_max\"", "where = \"rib\"").text;
  text = edited(text, "method = \"embedded\"", "visible = \"skin\"").text;
  const Scene scene = read_scene(write(text));
  EXPECT_FALSE(scene.tissue.grid.has_value());
  EXPECT_EQ(scene.tissue.mesh_file, folder_ / "meshes/lung.msh");
  EXPECT_EQ(scene.tissue.zones[1].region, "tumour");
  EXPECT_EQ(scene.tissue.supports[0].where, fem::Where(std::string("rib")));
  EXPECT_EQ(scene.visible, fem::Where(std::string("skin")));
  EXPECT_THROW((void)entry_m(scene), UserError);
}

TEST_F(SceneTest, ReadsExplicitContacts) {
  const auto text = edited(scene_text, "shaft_n_per_m = 34.0\ntip_n_per_m = 68.0\ntip_zone_m = 0.0025\nvelocity_law = \"ours\"",
                           "points_m = [[0, 0.16], [0.001, 0.17]]\nslip_force_n = [0.085, 0]")
                        .text;
  const Scene scene = read_scene(write(text));
  ASSERT_EQ(scene.contact->explicit_count, 2u);
  EXPECT_EQ(scene.contact->explicit_point_m[1], (std::array{0.001, 0.17}));
  EXPECT_EQ(scene.contact->explicit_slip_force_n[0], 0.085);
  EXPECT_EQ(scene.contact->explicit_slip_force_n[1], 0.0);
  EXPECT_EQ(scene.contact->shaft_n_per_m, 0.0);
  expect_parts(error_of(edited(text, "[0.085, 0]", "[0.085]").text, read_scene),
               {"contact.slip_force_n = [0.085]: 1 entries for 2 points"});
  expect_parts(error_of(edited(text, "slip_force_n = [0.085, 0]", "").text, read_scene), {"contact.slip_force_n: missing"});
  std::string points = "[0, 0.16]";
  std::string forces = "1";
  for (std::size_t i = 0; i < capacity::contacts; ++i) {
    points += ", [0, 0.16]";
    forces += ", 1";
  }
  expect_parts(error_of(edited(edited(text, "[[0, 0.16], [0.001, 0.17]]", "[" + points + "]").text, "[0.085, 0]", "[" + forces + "]").text,
                        read_scene),
               {"contact.points_m", "65 contacts; the tick carries at most 64 (capacity contacts)"});
}

TEST_F(SceneTest, ReadsEverySceneThatIsShipped) {
  std::size_t read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TROCAR_SHARE "/scenes")) {
    if (entry.path().extension() != ".toml") continue;
    EXPECT_NO_THROW(static_cast<void>(read_scene(entry.path())));
    ++read;
  }
  EXPECT_GE(read, 1u);
}

TEST_F(SceneTest, LeavesTheVelocityLawOutWhenNoneIsNamed) {
  for (const char* line : {"velocity_law = \"none\"\n", ""}) {
    const Scene scene = read_scene(write(edited(scene_text, "velocity_law = \"ours\"\n", line).text));
    EXPECT_EQ(scene.contact->velocity.rows, 0u);
    EXPECT_EQ(scene.velocity_law, "");
  }
}

TEST_F(SceneTest, NeedsDensitiesOnlyWithoutAVelocityLaw) {
  const auto text = edited(scene_text, "shaft_n_per_m = 34.0\n", "").text;
  EXPECT_EQ(read_scene(write(text)).contact->shaft_n_per_m, 34.0);
  expect_parts(error_of(edited(text, "velocity_law = \"ours\"\n", "").text, read_scene),
               {"file.toml:21: contact.shaft_n_per_m: missing in [contact]"});
}

TEST_F(SceneTest, SaysWhatIsNotAvailableYet) {
  refused("model = \"plane_stress\"", "image = \"ct.png\"",
          {"tissue.image = \"ct.png\": not available yet; describe the tissue with grid or file"});
}

TEST_F(SceneTest, RefusesElementsThatDoNotFitTheModel) {
  const auto solid = edited(scene_text, "model = \"plane_stress\"\nthickness_m = 0.011", "model = \"solid\"").text;
  expect_parts(error_of(solid, read_scene), {"tissue.grid.element = \"quad4\": a planar element in a solid"});
  expect_parts(error_of(edited(scene_text, "\"quad4\"", "\"hex8\"").text, read_scene), {"tissue.grid.element = \"hex8\"", "planar model"});
  expect_parts(error_of(edited(scene_text, "model = \"plane_stress\"", "model = \"solid\"").text, read_scene),
               {"tissue.thickness_m = 0.011", "remove the key"});
}

TEST_F(SceneTest, RefusesGridsThatCannotBe) {
  const auto with_spacing = [](const std::string& spacing) {
    return edited(scene_text, "nodes = [21, 25],", "nodes = [21, 25], spacing = " + spacing + ",").text;
  };
  EXPECT_NO_THROW((void)read_scene(write(with_spacing("[\"uniform\", { towards_m = 0.2, ratio = 1.1 }]"))));
  const auto refuses = [&](const std::string& spacing, std::initializer_list<std::string> parts) {
    expect_parts(error_of(with_spacing(spacing), read_scene), parts);
  };
  refuses("[\"uniform\"]", {"file.toml:4: tissue.grid.spacing", "1 entries; write one for each of the 2 axes"});
  refuses("[\"uniform\", \"log\"]", {"\"log\" is not known here"});
  refuses("[\"uniform\", { towards_m = 0.5, ratio = 1.1 }]", {"towards_m = 0.5: outside of the grid, which reaches from 0.15 to 0.27"});
  refuses("[\"uniform\", { towards_m = 0.2 }]", {"smallest_m: give either smallest_m"});
  refuses("[\"uniform\", { towards_m = 0.2, ratio = 1.1, smallest_m = 0.001 }]", {"smallest_m = 0.001: give either"});
  refuses("[\"uniform\", { towards_m = 0.2, smallest_m = 0.01 }]", {"smallest_m = 0.01: 25 nodes along y", "equal ones are 0.005 m"});
  refuses("[\"uniform\", { towards_m = 0.15, smallest_m = 1e-6, strange = 1 }]", {"tissue.grid.spacing.strange"});
  refuses("[{ towards_m = 0.04, smallest_m = 1e-6 }, \"uniform\"]", {"smallest_m = 1e-06: neighbouring elements differ by a factor of"});
  refused("nodes = [21, 25]", "nodes = [21, 1]", {"tissue.grid.nodes = [21, 1]: must be from 2 to"});
  refused("nodes = [21, 25]", "nodes = [21, 25, 3]", {"expected an array of 2 whole numbers"});
  refused("size_m = [0.1, 0.12], origin_m = [-0.05, 0.15], nodes = [21, 25]", "x_m = [0.1, 0.1], y_m = [0, 1]",
          {"tissue.grid.x_m = [0.1, 0.1]: must increase"});
  refused("nodes = [21, 25]", "nodes = [21, 25], x_m = [0.1, 0.2]", {"tissue.grid.size_m", "remove either these or those"});
  refused("model = \"plane_stress\"", "file = \"a.msh\"\nmodel = \"plane_stress\"",
          {"tissue.file = \"a.msh\": the tissue has a grid already"});
  refused("poisson = 0.48", "region = \"lung\"\npoisson = 0.48", {"tissue.material.region = \"lung\": a grid has no regions"});
  refused("method = \"embedded\"", "visible = \"skin\"", {"contact.visible = \"skin\": a grid has no groups"});
  refused("method = \"embedded\"", "visible = \"z_max\"", {"contact.visible = \"z_max\": a planar model has no such side"});
  refused("method = \"embedded\"", "plane_z_m = 0.1", {"contact.plane_z_m = 0.1", "remove the key"});
}

TEST_F(SceneTest, RefusesNeedlesThatCannotBe) {
  refused("length_m = 0.1\n", "gauge = \"22\"\nlength_m = 0.1\n",
          {"needle.gauge = \"22\": not in the table; write one from \"14G\" to \"30G\""});
  refused("length_m = 0.1\n", "outer_m = 0.001\nlength_m = 0.1\ngauge = \"22G\"\n", {"needle.outer_m = 0.001: the gauge says"});
  refused("length_m = 0.1\n", "inner_m = 0.001\nlength_m = 0.1\nouter_m = 0.001\n", {"needle.inner_m = 0.001: not smaller"});
  expect_parts(error_of(edited(scene_text, "model = \"rigid\"", "model = \"beam\"").text, read_scene),
               {"needle.outer_m: missing", "gauge = \"22G\""});
}

TEST_F(SceneTest, ReadsWhatANeedleIsMadeOf) {
  const auto with = [&](const std::string& keys) { return read_needle(write("[needle]\nmodel = \"beam\"\nlength_m = 0.15\n" + keys)); };
  const Needle nitinol = with("gauge = \"20G\"\nmaterial = \"nitinol\"\ncurvature_per_m = -3.0\nbevel_deg = -30\nbevel_friction = 0.4\n");
  EXPECT_EQ(nitinol.young_pa, 75e9);
  EXPECT_EQ(nitinol.curvature_per_m, -3.0);
  EXPECT_NEAR(nitinol.bevel.angle_rad, -0.52359877559829882, 1e-15);
  EXPECT_EQ(nitinol.bevel.friction, 0.4);
  EXPECT_NEAR(beam_of(nitinol).bending_nm2, 0.375 * 5.3754e-3, 1e-6);
  EXPECT_EQ(with("outer_m = 0.001\ninner_m = 0.0\nmaterial = \"steel\"\nbevel = \"symmetric\"\n").young_pa, 200e9);
  EXPECT_EQ(with("gauge = \"20G\"\nyoung_pa = 1e9\n").young_pa, 1e9);
  // Of a whole scene the same.
  EXPECT_EQ(read_needle(write(solid_text)).elements, 30);
  const auto refuses = [&](const std::string& keys, std::initializer_list<std::string> parts) {
    expect_parts(error_of("[needle]\nmodel = \"beam\"\nlength_m = 0.15\n" + keys, read_needle), parts);
  };
  refuses("gauge = \"20G\"\nmaterial = \"brass\"\n", {"file.toml:5: needle.material = \"brass\"", "steel", "nitinol"});
  refuses("gauge = \"20G\"\nmaterial = \"steel\"\nyoung_pa = 1e9\n", {"needle.young_pa = 1", "remove either material or young_pa"});
  refuses("outer_m = 0.001\ninner_m = 0.0\n", {"needle.young_pa: missing", "material"});
  refuses("gauge = \"20G\"\nbevel_deg = 2\n", {"needle.bevel_deg = 2: flatter than 5 degrees"});
  refuses("gauge = \"20G\"\nbevel = \"symmetric\"\nbevel_deg = 30\n", {"needle.bevel_deg = 30", "remove either"});
  refuses("gauge = \"20G\"\nbevel_friction = 0.3\n", {"needle.bevel_friction = 0.3", "add bevel_deg"});
  refuses("gauge = \"20G\"\ncurvature_per_m = 50.0\n", {"needle.curvature_per_m = 50"});
  refuses("gauge = \"20G\"\nelements = 65\n", {"needle.elements = 65", "64"});
  refuses("gauge = \"20G\"\nlenght = 65\n", {"needle.lenght", "unknown key"});
  expect_parts(error_of("[needle]\nmodel = \"rigid\"\nlength_m = 0.1\n", [](const auto& file) { return beam_of(read_needle(file)); }),
               {"file.toml:2: needle.model = \"rigid\"", "write \"beam\""});
}

TEST_F(SceneTest, ReadsTheTrianglesOfTheThesis) {
  const auto with = [&](const std::string& keys) {
    return triangles_of(read_needle(write("[needle]\nmodel = \"thesis\"\nlength_m = 0.15\ngauge = \"20G\"\n" + keys)));
  };
  const fem::ThesisNeedleProperties steel = with("");
  EXPECT_EQ(steel.elements, 15);
  EXPECT_EQ(steel.depth_m, 0.908e-3);
  EXPECT_EQ(steel.thickness_m, 0.908e-3);
  EXPECT_NEAR(steel.young_pa, 674e6, 1e6);
  EXPECT_NEAR(with("material = \"nitinol\"\n").young_pa / steel.young_pa, 0.375, 1e-8);
  EXPECT_EQ(with("young_pa = 980e6\nelements = 40\n").young_pa, 980e6);
  EXPECT_EQ(with("young_pa = 980e6\nelements = 40\n").elements, 40);
}

TEST_F(SceneTest, RefusesWhatCannotBeComputed) {
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
}

TEST_F(SceneTest, RefusesVelocityLawsThatDoNotFit) {
  refused("velocity_law = \"ours\"", "velocity_law = \"theirs\"",
          {"contact.velocity_law = \"theirs\": no [[velocity_law]] of this file", "\"none\", \"ours\""});
  refused("speed_m_s = [0.001, 0.005, 0.009]", "speed_m_s = [0.005, 0.001, 0.009]", {"velocity_law.speed_m_s", "must increase"});
  refused("tip_n_per_m = [68.0, 60.0, 61.0]", "tip_n_per_m = [68.0, 60.0]",
          {"velocity_law.tip_n_per_m = [68, 60]: 2 entries for 3 speeds"});
  refused("speed_m_s = [0.001, 0.005, 0.009]", "speed_mm_s = [1, 5, 9]",
          {"speeds are in metres per second: write speed_m_s = [0.001, 0.005, 0.009]"});
}

}  // namespace
}  // namespace trocar::scene
