// Z-width of a one-axis device, two channels against four: passive walls by rate, rendered against felt stiffness, free space.
// Nothing here is measured in time. Exit code 1 when a result contradicts what is known: a bare spring over two channels is passive
// up to b / (1.5 T) and feels as stiff as it is (2 %: friction is 0.03 of 2.5 N), an admittance feels as its spring and tracking stiffness
// in series (2 %).
//   haptic_benchmark [--out FOLDER] [--quick]
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include "tests/benchmarks/haptic/output.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

using control::Display;

int run(const Options& options) {
  fmt::print(stderr, "haptic_benchmark: passive walls …\n");
  // 2 N s/m: a light hand's least damping, counted to the device; the hands that try the loop have none.
  reference::AxisPlant device;
  device.viscous_n_s_m = 2.0;
  device.coulomb_n = 0.0;
  const std::vector<Scheme> schemes{{"two channels", Display::Impedance, 0.0},
                                    {"four channels", Display::FourChannel, 0.0},
                                    {"four channels at 2 N", Display::FourChannel, 120.0}};
  const std::vector<double> dampings =
      options.quick ? std::vector{0.0, 5.0} : std::vector{0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0};
  std::vector<WallRow> walls;
  for (const Scheme& scheme : schemes)
    for (const double hz : {512.0, 1000.0, 2000.0, 4000.0})
      for (const double damping : dampings) {
        device.tick_hz = hz;
        walls.push_back(largest_wall(device, scheme, damping));
      }

  // A bare spring over one tick of delay: K T (1/2 + 1) < b (Colgate's bound with the delay's phase), within the grid of hands.
  bool sound = true;
  for (const WallRow& r : walls)
    if (r.scheme == "two channels" && r.damping_n_s_m == 0.0) {
      const double bound = device.viscous_n_s_m * r.tick_hz / 1.5;
      sound = sound && r.stiffness_n_m >= 0.98 * bound && r.stiffness_n_m <= 1.1 * bound;
    }

  fmt::print(stderr, "haptic_benchmark: what is felt …\n");
  const std::vector<Scheme> felt_schemes{
      {"two channels", Display::Impedance, 0.0}, {"admittance", Display::Admittance, 0.0}, {"four channels", Display::FourChannel, 0.0}};
  std::vector<FeltRow> felt;
  std::vector<FreeRow> free;
  double two_off = 0.0, series_off = 0.0, four_off = 0.0;
  const double tracking = control::AdmittanceConfig{}.tracking.stiffness[0];
  for (const Scheme& scheme : felt_schemes) {
    for (const double k : {50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0}) {
      felt.push_back(felt_stiffness(scheme, k));
      const double is = felt.back().felt_n_m;
      if (scheme.display == Display::Impedance) two_off = std::max(two_off, std::abs(is / k - 1.0));
      if (scheme.display == Display::FourChannel) four_off = std::max(four_off, std::abs(is / k - 1.0));
      if (scheme.display == Display::Admittance) series_off = std::max(series_off, std::abs(is * (1.0 / k + 1.0 / tracking) - 1.0));
    }
    for (const double hz : {0.5, 1.0, 2.0, 4.0}) free.push_back(free_space(scheme, hz));
  }
  print(walls);
  print(felt);
  print(free);
  fmt::print("\nbare spring against b / (1.5 T): {}\n", sound ? "agrees" : "DISAGREES");
  fmt::print("felt stiffness, worst error: two channels {:.2f} %, four channels {:.2f} %, admittance against the series {:.2f} %\n",
             100.0 * two_off, 100.0 * four_off, 100.0 * series_off);
  write(options.out, walls, felt, free);
  fmt::print("tables and figures: {}\n", options.out.string());
  return sound && two_off <= 0.02 && series_off <= 0.02 ? 0 : 1;
}

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program("haptic_benchmark", count, argument, trocar::bench::run); }
