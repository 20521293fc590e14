#include "sim_plant/plant/plant_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <string>

#include "common/config/user_error.hpp"
#include "machine.hpp"

namespace trocar::sim_plant {
namespace {

std::string shipped_text() {
  std::ifstream file(shared("plants/ubc_twin.toml"));
  return {std::istreambuf_iterator<char>(file), {}};
}

// The message that the shipped file ends in once `from` is replaced.
std::string refusal(const std::string& from, const std::string& to) {
  std::string text = shipped_text();
  const std::size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  text.replace(place, from.size(), to);
  const auto file = std::filesystem::temp_directory_path() / ("trocar_plant_" + std::to_string(::getpid()) + ".toml");
  std::ofstream(file) << text;
  std::string message;
  try {
    (void)read_plant(file);
  } catch (const config::UserError& error) {
    message = error.what();
  }
  std::filesystem::remove(file);
  return message;
}

TEST(PlantFile, ReadsTheShippedPlant) {
  const PlantConfig plant = shipped_plant();
  EXPECT_EQ(plant.step_hz, 10000.0);
  EXPECT_EQ(plant.current_loop_hz, 600.0);
  EXPECT_EQ(plant.friction[3].coulomb_nm, 0.018);
  EXPECT_EQ(plant.friction[1].viscous_nm_s, 0.0022);
  EXPECT_EQ(plant.friction[0].stiffness_nm_per_rad, 60.0);
  EXPECT_EQ(plant.imperfection.link_error_m[1][2], -1.5e-5);
  EXPECT_EQ(plant.stop_singularity, 0.2);
  EXPECT_EQ(plant.force_noise_n, 0.0125);
}

TEST(PlantFile, NamesKeyAndRemedyOfAMistake) {
  EXPECT_NE(refusal("step_hz = 10000", "step_hz = 30000").find("step_hz"), std::string::npos);
  EXPECT_NE(refusal("current_loop_hz = 600.0", "current_loop_hz = -1").find("current_loop_hz"), std::string::npos);
  EXPECT_NE(refusal("margin_m", "margin_mm").find("margin_m"), std::string::npos);
  EXPECT_NE(refusal("coulomb_nm = [0.017, 0.016, 0.014, 0.018]", "coulomb_nm = [0.017]").find("coulomb_nm"), std::string::npos);
  EXPECT_NE(refusal("mass_factor = 1.04", "mass_factor = 1.04\nmass_facter = 1").find("mass_facter"), std::string::npos);
  EXPECT_NE(refusal("[sensor]", "[sensors]"), "");
}

TEST(PlantFile, TheShippedSceneHasTheThesissDensities) {
  const scene::Scene scene = shipped_scene();
  const contact::Law& law = *scene.contact;
  ASSERT_EQ(law.velocity.rows, 5u);
  // At the printed speed the law gives the printed densities.
  EXPECT_EQ(law.velocity.speed_m_s[0], 0.001);
  EXPECT_EQ(law.velocity.shaft_n_per_m[0], law.shaft_n_per_m);
  EXPECT_EQ(law.velocity.tip_n_per_m[0], law.tip_n_per_m);
  // And at 9 mm/s the tip's peak is below 0.1 % of the force at 70 mm.
  const double excess = law.velocity.tip_n_per_m[4] - law.velocity.shaft_n_per_m[4];
  EXPECT_LT(excess * law.tip_zone_m, 0.001 * 0.07 * law.velocity.shaft_n_per_m[4]);
}

// 70 mm of insertion from the middle, with room before the tissue, must fit into the rig's workspace.
TEST(PlantFile, SceneFitsTheRig) {
  const rig::Rig rig = shipped_rig();
  const scene::Scene scene = shipped_scene();
  const double at_contact = scene.tissue.grid->axis_m[1].front() - scene.needle->length_m;
  EXPECT_GT(at_contact, rig.homing_pose[1] + 0.002);
  EXPECT_LT(at_contact + 0.070 + 0.010, rig.limits.workspace_y_m[1]);
}

}  // namespace
}  // namespace trocar::sim_plant
