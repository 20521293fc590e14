// The figures that the rig files promise in their comments, computed from the files themselves.
#include <gtest/gtest.h>

#include <toml++/toml.h>
#include <string>

#include "common/mechanism/capability.hpp"
#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::pi;

constexpr double degrees = 180.0 / pi;

double number(const toml::table& file, const char* path) { return file.at_path(path).value<double>().value(); }

toml::table load(const char* name) { return toml::parse_file(std::string(TROCAR_RIGS) + "/" + name); }

FiveBarModel linkage(const toml::table& file, std::size_t first_drive) {
  FiveBarModel model;
  model.base_m = number(file, "linkage.base_m");
  model.end_point_mass_kg = number(file, "linkage.end_point_mass_kg");
  const double rotor = number(file, "actuation.rotor_inertia_kg_m2");
  for (std::size_t side = 0; side < 2; ++side) {
    for (const bool proximal : {true, false}) {
      const auto at = [&](const char* key) {
        return number(file,
                      (std::string(proximal ? "linkage.proximal." : "linkage.distal.") + key + "[" + std::to_string(side) + "]").c_str());
      };
      (proximal ? model.proximal : model.distal)[side] = {at("length_m"), at("mass_kg"), at("com_m"), at("inertia_kg_m2")};
    }
    const double ratio = number(file, ("actuation.gear_ratio[" + std::to_string(first_drive + side) + "]").c_str());
    model.reflected_inertia_kg_m2[side] = rotor * ratio * ratio;
  }
  return model;
}

TwinModel twin(const toml::table& file) {
  TwinModel model;
  model.linkage = {linkage(file, 0), linkage(file, 2)};
  model.coupling_m = number(file, "coupling.length_m");
  model.handle_m = number(file, "coupling.handle_m");
  model.handle_mass_kg = number(file, "coupling.handle_mass_kg");
  model.handle_com_m = number(file, "coupling.handle_com_m");
  model.handle_inertia_kg_m2 = number(file, "coupling.handle_inertia_kg_m2");
  return model;
}

DriveLimits drives(const toml::table& file) {
  DriveLimits out;
  const double per_ampere = number(file, "actuation.torque_constant_nm_per_a") * number(file, "actuation.gear_efficiency");
  for (std::size_t i = 0; i < file.at_path("actuation.gear_ratio").as_array()->size(); ++i) {
    const double torque = per_ampere * number(file, ("actuation.gear_ratio[" + std::to_string(i) + "]").c_str());
    out.continuous_torque_nm(static_cast<Eigen::Index>(i)) = torque * number(file, "actuation.continuous_current_a");
    out.peak_torque_nm(static_cast<Eigen::Index>(i)) = torque * number(file, "actuation.peak_current_a");
  }
  out.encoder_counts_per_turn = number(file, "actuation.encoder_counts_per_turn");
  return out;
}

Rectangle limits(const toml::table& file) {
  return {{number(file, "limits.workspace_x_m[0]"), number(file, "limits.workspace_x_m[1]")},
          {number(file, "limits.workspace_y_m[0]"), number(file, "limits.workspace_y_m[1]")}};
}

constexpr Rectangle square{{-0.05, 0.05}, {0.10, 0.20}};
constexpr Sampling sampling{11, 36};  // quick enough without optimisation

TEST(ShippedRigs, ManipulatorMeetsTheThesisFigures) {
  const toml::table file = load("ubc_twin.toml");
  const Capability result = capability(twin(file), drives(file), square, sampling);
  ASSERT_EQ(result.status, Status::Ok);
  const Figures& worst = result.worst;
  EXPECT_NEAR(worst.position_step_m * 1e6, 21.4, 0.5);        // thesis: about 40
  EXPECT_NEAR(worst.angle_step_rad * degrees, 0.049, 0.001);  // thesis: about 0.05
  EXPECT_NEAR(worst.peak_force_n, 66.0, 1.0);                 // thesis: above 30
  EXPECT_NEAR(worst.continuous_force_n, 13.2, 0.1);           // thesis: 12
  EXPECT_NEAR(worst.mass_least_kg, 0.31, 0.01);
  EXPECT_NEAR(worst.mass_most_kg, 0.71, 0.01);
  EXPECT_NEAR(worst.inertia_kg_m2, 4.5e-4, 0.1e-4);
  DriveLimits after_friction = drives(file);
  after_friction.continuous_torque_nm.array() -= number(file, "actuation.friction_coulomb_nm");
  EXPECT_GT(capability(twin(file), after_friction, square, sampling).worst.continuous_force_n, 12.0);
  EXPECT_NEAR(largest_square(twin(file), 0.3, 0.004, 24).side_m, 0.118, 0.005);
}

TEST(ShippedRigs, HapticDeviceGivesWhatItsFilePrints) {
  const toml::table file = load("ubc_twin_haptic.toml");
  const Capability result = capability(twin(file), drives(file), square, sampling);
  ASSERT_EQ(result.status, Status::Ok);
  EXPECT_NEAR(result.worst.continuous_force_n, 1.95, 0.05);
  EXPECT_NEAR(result.worst.peak_force_n, 9.7, 0.1);
  EXPECT_NEAR(result.worst.continuous_force_best_n, 2.7, 0.05);
  EXPECT_NEAR(result.worst.mass_least_kg, 0.26, 0.01);
  EXPECT_NEAR(result.worst.mass_most_kg, 0.39, 0.01);
}

TEST(ShippedRigs, SingleLinkageGivesWhatItsFilePrints) {
  const toml::table file = load("five_bar.toml");
  const FiveBarModel model = linkage(file, 0);
  FiveBarPose pose;
  ASSERT_EQ(forward(model, {pi - 0.5, 0.5}, pose), Status::Ok);
  EXPECT_NEAR(pose.end.x(), number(file, "homing.pose[0]"), 1e-15);
  EXPECT_NEAR(pose.end.y(), number(file, "homing.pose[1]"), 1e-15);
  const Capability result = capability(model, drives(file), {{-0.06, 0.06}, {0.10, 0.22}});
  ASSERT_EQ(result.status, Status::Ok);
  EXPECT_NEAR(result.worst.position_step_m * 1e6, 41.0, 0.5);
  EXPECT_NEAR(result.worst.continuous_force_n, 1.0, 0.02);
  EXPECT_NEAR(result.worst.peak_force_n, 5.0, 0.1);
}

TEST(ShippedRigs, WorkspaceLimitsAndHomingPoseLieWithinTheSingularityLimit) {
  for (const char* name : {"ubc_twin.toml", "ubc_twin_haptic.toml"}) {
    const toml::table file = load(name);
    const Capability result = capability(twin(file), drives(file), limits(file), sampling);
    ASSERT_EQ(result.status, Status::Ok);
    EXPECT_GT(result.worst.singularity, number(file, "limits.singularity") + 0.1);
    const Vec3 home(number(file, "homing.pose[0]"), number(file, "homing.pose[1]"), number(file, "homing.pose[2]"));
    EXPECT_GT(home.y(), limits(file).y_m[0]);
    EXPECT_LT(home.y(), limits(file).y_m[1]);
    EXPECT_GE(result.worst.continuous_force_n * number(file, "actuation.peak_current_a") / number(file, "actuation.continuous_current_a"),
              number(file, "limits.command_force_n"));
  }
  const toml::table file = load("five_bar.toml");
  const Capability result = capability(linkage(file, 0), drives(file), limits(file), sampling);
  ASSERT_EQ(result.status, Status::Ok);
  EXPECT_GT(result.worst.singularity, number(file, "limits.singularity") + 0.1);
}

TEST(ShippedRigs, DefaultGainsAreStableForTheMassTheyMove) {
  // Continuous PID on a free mass: stable when m < Kp Kd / Ki; the files keep a factor of four.
  for (const char* name : {"ubc_twin.toml", "ubc_twin_haptic.toml"}) {
    const toml::table file = load(name);
    const Capability result = capability(twin(file), drives(file), limits(file), sampling);
    const auto bound = [&](const std::string& axis) {
      const std::string gains = "gains[0]." + axis + ".";
      return number(file, (gains + "proportional").c_str()) * number(file, (gains + "derivative").c_str()) /
             number(file, (gains + "integral").c_str());
    };
    EXPECT_GT(bound("translation"), 4.0 * result.worst.mass_most_kg);
    EXPECT_GT(bound("rotation"), 4.0 * result.worst.inertia_kg_m2);
  }
}

}  // namespace
}  // namespace trocar::mechanism
