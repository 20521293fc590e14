#include "common/capture/samples_csv.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

#include "example.hpp"

namespace {

using namespace trocar;
using namespace trocar::capture;

std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(line);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

TEST(SamplesCsv, EveryNumberReadsBackToTheSameValueUnderItsName) {
  const Sample s = example::sample(123457);
  std::string row;
  append_samples_csv(row, s);
  const auto names = split(std::string(samples_csv_header()), ',');
  const auto values = split(row, ',');
  ASSERT_EQ(names.size(), values.size());
  std::map<std::string, std::string> cell;
  for (std::size_t i = 0; i < names.size(); ++i) cell[names[i]] = values[i];
  ASSERT_EQ(cell.size(), names.size()) << "two columns share a name";

  const auto real = [&](const char* name) { return std::strtod(cell.at(name).c_str(), nullptr); };
  EXPECT_EQ(cell["tick"], "123457");
  EXPECT_EQ(cell["time_ns"], "123457000000");
  EXPECT_EQ(cell["mode"], "Position");
  EXPECT_EQ(cell["fault"], "None");
  EXPECT_EQ(cell["moving"], "1");
  EXPECT_EQ(cell["gain_set"], "2");
  EXPECT_EQ(cell["command_id"], "3");
  EXPECT_EQ(std::stoi(cell["position_3_counts"]), s.position_counts[3]);
  EXPECT_EQ(real("joint_torque_command_0_nm"), s.joint_torque_command_nm[0]);
  EXPECT_EQ(real("joint_torque_measured_3_nm"), s.joint_torque_measured_nm[3]);
  EXPECT_EQ(real("x_m"), s.pose[0]);
  EXPECT_EQ(real("y_m"), s.pose[1]);
  EXPECT_EQ(real("theta_rad"), s.pose[2]);
  EXPECT_EQ(real("vx_m_s"), s.velocity[0]);
  EXPECT_EQ(real("omega_rad_s"), s.velocity[2]);
  EXPECT_EQ(real("setpoint_x_m"), s.setpoint_pose[0]);
  EXPECT_EQ(real("setpoint_omega_rad_s"), s.setpoint_velocity[2]);
  EXPECT_EQ(real("command_fx_n"), s.wrench_command[0]);
  EXPECT_EQ(real("base_fx_n"), s.base_wrench[0]);
  EXPECT_EQ(real("base_fy_n"), s.base_wrench[1]);
  EXPECT_EQ(real("base_tau_nm"), s.base_wrench[2]);
  EXPECT_EQ(real("residual_m"), s.residual_m);
  EXPECT_EQ(real("singularity"), s.singularity);
  EXPECT_EQ(std::stoul(cell["missed_feedback_ticks"]), s.missed_feedback);
  EXPECT_EQ(std::strtof(cell["wakeup_late_us"].c_str(), nullptr), s.wakeup_late_us);
  EXPECT_EQ(std::strtof(cell["tick_us"].c_str(), nullptr), s.tick_us);
  EXPECT_EQ(real("handle_fy_n"), s.handle_wrench[1]);
  EXPECT_EQ(real("virtual_theta_rad"), s.virtual_pose[2]);
  EXPECT_EQ(real("virtual_tau_nm"), s.virtual_wrench[2]);
  EXPECT_EQ(real("display_energy_j"), s.display_energy_j);
  EXPECT_EQ(std::stoul(cell["virtual_contacts"]), s.virtual_contacts);
  EXPECT_EQ(std::stoul(cell["virtual_status"]), s.virtual_status);
}

TEST(SamplesCsv, PrintsAsPrintfWithSeventeenDigits) {
  Sample s;
  for (const double value :
       {0.1, -0.0, 1e-300, 5e-324, 1.7976931348623157e308, 100000.0, 1e17, 123456789012345680.0, 0.0001, 0.00001, 1.0 / 3}) {
    s.residual_m = value;
    std::string row;
    append_samples_csv(row, s);
    char expected[64];
    std::snprintf(expected, sizeof expected, ",%.17g,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n", value);
    EXPECT_TRUE(row.ends_with(expected)) << row << expected;
  }
  s.residual_m = -std::numeric_limits<double>::quiet_NaN();
  std::string row;
  append_samples_csv(row, s);
  EXPECT_TRUE(row.ends_with(",nan,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n")) << row;
}

TEST(SamplesCsv, EqualSamplesGiveEqualBytesAndGapsStayGaps) {
  const example::Folder folder;
  auto samples = example::samples(0, 3000);
  samples.erase(samples.begin() + 100, samples.begin() + 140);
  const TickCounter ticks = write_samples_csv(folder / "a.csv", samples);
  write_samples_csv(folder / "b.csv", samples);
  const std::string a = example::slurp(folder / "a.csv");
  EXPECT_EQ(a, example::slurp(folder / "b.csv"));
  EXPECT_EQ(std::count(a.begin(), a.end(), '\n'), 1 + 2960);
  EXPECT_EQ(ticks.lost(), 40u);
  EXPECT_EQ(ticks.gaps(), 1u);
  EXPECT_EQ(folder.files(), 2u);
}

TEST(SamplesCsv, LeavesNothingBehindWhenItIsNotFinishedOrCannotBe) {
  const example::Folder folder;
  {
    SamplesCsv csv(folder / "a.csv");
    csv.write(example::sample(1));
  }
  EXPECT_EQ(folder.files(), 0u);
  try {
    SamplesCsv csv(folder / "missing/a.csv");
    FAIL() << "no error";
  } catch (const CaptureError& error) {
    EXPECT_NE(std::string_view(error.what()).find("missing/a.csv"), std::string_view::npos) << error.what();
  }
}

}  // namespace
