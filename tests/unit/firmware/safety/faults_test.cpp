#include "firmware/safety/faults.hpp"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <filesystem>
#include <set>
#include <string>

#include "common/config/rig_file.hpp"
#include "readme_table.hpp"

namespace trocar::safety {
namespace {

TEST(Faults, EveryFaultHasItsRowInTheOrderOfTheEnum) {
  ASSERT_EQ(static_cast<std::size_t>(Fault::TorqueMismatch) + 1, fault_count);
  for (std::size_t i = 0; i < fault_count; ++i) {
    const auto fault = static_cast<Fault>(i);
    EXPECT_EQ(row(fault).fault, fault) << to_string(fault);
    EXPECT_STRNE(to_string(fault), "?");
  }
}

TEST(Faults, EachSaysSomethingOfItsOwn) {
  std::set<std::string> causes;
  for (const FaultRow& r : fault_table) {
    ASSERT_NE(r.cause, nullptr);
    ASSERT_NE(r.remedy, nullptr);
    EXPECT_FALSE(std::string(r.remedy).empty());
    EXPECT_TRUE(causes.insert(r.cause).second) << r.cause;
  }
}

TEST(Faults, WithoutATrustworthyMeasurementThereIsNoTorque) {
  for (const Fault f :
       {Fault::FeedbackLost, Fault::HeartbeatLost, Fault::DriveFault, Fault::EncoderJump, Fault::Inconsistent, Fault::NotFinite})
    EXPECT_EQ(row(f).reaction, Reaction::TorqueOff) << to_string(f);
}

// What the rig file says that each fault waits for.
std::string limit(Fault fault, const rig::Rig& rig) {
  const rig::Limits& l = rig.limits;
  switch (fault) {
    case Fault::FeedbackLost:
    case Fault::SensorLost:
    case Fault::SolverNotConverged:
      return fmt::format("{} ticks", patience_ticks(fault, rig));
    case Fault::HeartbeatLost:
      return fmt::format("{} ms", rig.timing.heartbeat_timeout_ms);
    case Fault::TorqueMismatch:
      return fmt::format("{:g} N m for {} ticks", l.torque_error_nm, l.torque_error_ticks);
    case Fault::LateTick:
      return fmt::format("{:g} ms", 1e-3 * rig.timing.late_tick_us);
    case Fault::Inconsistent:
      return fmt::format("{:g} mm", 1e3 * l.residual_m);
    case Fault::TrackingError:
      return fmt::format("{:g} mm, {:g} rad", 1e3 * l.tracking_m, l.tracking_rad);
    case Fault::ForceLimit:
      return fmt::format("{:g} N, {:g} N m", l.fault_force_n, l.fault_moment_nm);
    case Fault::VelocityLimit:
      return fmt::format("{:g} m/s, {:g} rad/s", l.fault_speed_m_s, l.fault_angular_speed_rad_s);
    case Fault::WorkspaceLimit:
      return fmt::format("x {:g} … {:g}, y {:g} … {:g} mm", 1e3 * l.workspace_x_m[0], 1e3 * l.workspace_x_m[1], 1e3 * l.workspace_y_m[0],
                         1e3 * l.workspace_y_m[1]);
    case Fault::Singular:
      return fmt::format("{:g}", l.singularity);
    default:
      return "at once";
  }
}

TEST(Faults, ReadmeShowsTheTableAndTheLimitsOfTheShippedRig) {
  const rig::Rig rig = config::read_rig(std::filesystem::path(TROCAR_SOURCE) / "host/share/rigs/ubc_twin.toml");
  static constexpr const char* reactions[] = {"hold", "quick stop", "torque off"};
  std::string table = "| fault | cause | limit | reaction | what to do |\n|---|---|---|---|---|\n";
  for (const FaultRow& r : fault_table)
    if (r.fault != Fault::None)
      table += fmt::format("| {} | {} | {} | {} | {} |\n", to_string(r.fault), r.cause, limit(r.fault, rig),
                           reactions[static_cast<std::size_t>(r.reaction)], r.remedy);
  testing::expect_shown("firmware/safety/README.md", "fault table", table);
}

}  // namespace
}  // namespace trocar::safety
