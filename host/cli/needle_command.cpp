#include "host/cli/needle_command.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <memory>

#include "common/config/new_file.hpp"
#include "common/config/user_error.hpp"
#include "common/needle/beam.hpp"
#include "common/scene/scene.hpp"

namespace trocar::cli {
namespace {

// Empty when the text is anything but finite numbers between commas.
std::vector<double> numbers_of(const std::string& text) {
  std::vector<double> numbers;
  const char* at = text.c_str();
  while (true) {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    if (end == at || !std::isfinite(numbers.back())) return {};
    if (*end == '\0') return numbers;
    if (*end != ',') return {};
    at = end + 1;
  }
}

std::vector<needle::Load> loads_of(const NeedleBendOptions& options, double length_m) {
  needle::Load tip{length_m, {}, options.tip_moment_nm};
  if (!options.tip_force.empty()) {
    const std::vector<double> force = numbers_of(options.tip_force);
    tip.force_n = {force.at(0), force.at(1)};
  }
  std::vector<needle::Load> loads{tip};
  for (const std::string& text : options.at) {
    const std::vector<double> at = numbers_of(text);
    if (at.at(0) < 0.0 || at.at(0) > length_m)
      throw config::UserError(
          fmt::format("--at {}: {} m is not on the needle, which reaches from 0 to {} m; give S in between", text, at[0], length_m));
    loads.push_back({at[0], {at.at(1), at.at(2)}, 0.0});
  }
  if (loads.size() > needle::Beam::most_loads)
    throw config::UserError(fmt::format("--at: {} forces; at most {} fit (capacity needle_loads, with the tip's)", options.at.size(),
                                        needle::Beam::most_loads - 1));
  return loads;
}

[[noreturn]] void fail(const NeedleBendOptions& options, const needle::Result& result) {
  const std::string name = options.needle.string();
  switch (result.status) {
    case needle::Status::Unstable:
      throw config::UserError(fmt::format("{}: the needle is {}; add a small lateral force, such as --at with 1e-6 N across the shaft",
                                          name, to_string(result.status)));
    case needle::Status::NotConverged:
      throw config::UserError(
          fmt::format("{}: no equilibrium in {} iterations (residual {:.3g} N m); lower the loads, or give more elements", name,
                      result.iterations, result.residual_nm));
    default:
      throw config::UserError(fmt::format("{}: these loads end in numbers that are not finite; lower them", name));
  }
}

}  // namespace

std::string wrong_numbers(const std::string& text, std::size_t count, const char* pattern) {
  if (numbers_of(text).size() == count) return {};
  return fmt::format("{}: write {}, {} finite numbers with commas between and no spaces", text, pattern, count);
}

int needle_bend(const NeedleBendOptions& options) {
  const needle::Properties properties = scene::beam_of(scene::read_needle(options.needle));
  const std::vector<needle::Load> loads = loads_of(options, properties.length_m);
  config::NewFile file(options.out);
  const auto beam = std::make_unique<needle::Beam>();
  if (const needle::Status status = beam->open(properties); status != needle::Status::Ok)
    throw config::UserError(fmt::format("{}: needle: {}; look at its diameters and young_pa", options.needle.string(), to_string(status)));
  const needle::Result result = beam->solve({}, loads);
  if (result.status != needle::Status::Ok) fail(options, result);

  file.stream() << "s_m,x_m,y_m,theta_rad\n";
  for (std::size_t k = 0; k < beam->nodes(); ++k) {
    const double s = beam->node_arclength_m(k);
    const needle::Station at = beam->at(s);
    file.stream() << fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", s, at.position_m[0], at.position_m[1], at.theta_rad);
  }
  file.keep();
  const needle::Station tip = beam->tip();
  const needle::Wrench base = beam->reaction();
  if (options.json)
    fmt::print(
        "{{\"rows\": {}, \"tip_x_m\": {:.17g}, \"tip_y_m\": {:.17g}, \"tip_theta_rad\": {:.17g}, \"base_fx_n\": {:.17g}, \"base_fy_n\": "
        "{:.17g}, \"base_tau_nm\": {:.17g}, \"bending_nm2\": {:.17g}, \"axial_n\": {:.17g}, \"iterations\": {}, \"residual_nm\": "
        "{:.3g}}}\n",
        beam->nodes(), tip.position_m[0], tip.position_m[1], tip.theta_rad, base.fx_n, base.fy_n, base.tau_nm, properties.bending_nm2,
        properties.axial_n, result.iterations, result.residual_nm);
  else
    fmt::print("tip at {:.6g}, {:.6g} mm, {:.5g} degrees; the base holds with {:.6g}, {:.6g} N and {:.6g} N m; {} rows, {} iterations\n",
               1e3 * tip.position_m[0], 1e3 * tip.position_m[1], tip.theta_rad * 57.295779513082323, base.fx_n, base.fy_n, base.tau_nm,
               beam->nodes(), result.iterations);
  return 0;
}

}  // namespace trocar::cli
