#include "host/cli/needle_command.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <memory>

#include "common/config/new_file.hpp"
#include "common/config/user_error.hpp"
#include "common/fem/thesis_needle.hpp"
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

struct At {
  double arclength_m{};
  needle::Vector2 force_n{};
};

// Of --tip-force, and of every --at.
std::vector<At> forces_of(const NeedleBendOptions& options, double length_m) {
  At tip{length_m, {}};
  if (!options.tip_force.empty()) {
    const std::vector<double> force = numbers_of(options.tip_force);
    tip.force_n = {force.at(0), force.at(1)};
  }
  std::vector<At> forces{tip};
  for (const std::string& text : options.at) {
    const std::vector<double> at = numbers_of(text);
    if (at.at(0) < 0.0 || at.at(0) > length_m)
      throw config::UserError(
          fmt::format("--at {}: {} m is not on the needle, which reaches from 0 to {} m; give S in between", text, at[0], length_m));
    forces.push_back({at[0], {at.at(1), at.at(2)}});
  }
  return forces;
}

constexpr const char* header = "s_m,x_m,y_m,theta_rad\n";

std::string row(double s, const needle::Vector2& at, double theta_rad) {
  return fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", s, at[0], at[1], theta_rad);
}

// Where the tip is and what the base does, with a comma for what follows.
std::string json_of(const needle::Vector2& tip, double theta_rad, const needle::Wrench& base) {
  return fmt::format(
      "\"tip_x_m\": {:.17g}, \"tip_y_m\": {:.17g}, \"tip_theta_rad\": {:.17g}, \"base_fx_n\": {:.17g}, \"base_fy_n\": {:.17g}, "
      "\"base_tau_nm\": {:.17g}, ",
      tip[0], tip[1], theta_rad, base.fx_n, base.fy_n, base.tau_nm);
}

std::string text_of(const needle::Vector2& tip, double theta_rad, const needle::Wrench& base) {
  return fmt::format("tip at {:.6g}, {:.6g} mm, {:.5g} degrees; the base holds with {:.6g}, {:.6g} N and {:.6g} N m", 1e3 * tip[0],
                     1e3 * tip[1], theta_rad * 57.295779513082323, base.fx_n, base.fy_n, base.tau_nm);
}

constexpr const char* how_to_steady = "add a small lateral force, such as --at with 1e-6 N across the shaft";

[[noreturn]] void fail(const NeedleBendOptions& options, const needle::Result& result) {
  const std::string name = options.needle.string();
  switch (result.status) {
    case needle::Status::Unstable:
      throw config::UserError(fmt::format("{}: the needle is {}; {}", name, to_string(result.status), how_to_steady));
    case needle::Status::NotConverged:
      throw config::UserError(
          fmt::format("{}: no equilibrium in {} iterations (residual {:.3g} N m); lower the loads, or give more elements", name,
                      result.iterations, result.residual_nm));
    default:
      throw config::UserError(fmt::format("{}: these loads end in numbers that are not finite; lower them", name));
  }
}

int bend_beam(const NeedleBendOptions& options, const needle::Properties& properties) {
  std::vector<needle::Load> loads;
  for (const At& f : forces_of(options, properties.length_m)) loads.push_back({f.arclength_m, f.force_n, 0.0});
  loads.front().moment_nm = options.tip_moment_nm;
  if (loads.size() > needle::Beam::most_loads)
    throw config::UserError(fmt::format("--at: {} forces; at most {} fit (capacity needle_loads, with the tip's)", options.at.size(),
                                        needle::Beam::most_loads - 1));
  config::NewFile file(options.out);
  const auto beam = std::make_unique<needle::Beam>();
  if (const needle::Status status = beam->open(properties); status != needle::Status::Ok)
    throw config::UserError(fmt::format("{}: needle: {}; look at its diameters and young_pa", options.needle.string(), to_string(status)));
  const needle::Result result = beam->solve({}, loads);
  if (result.status != needle::Status::Ok) fail(options, result);
  for (std::size_t k = 0; k < beam->nodes(); ++k)
    if (const double stretch = beam->at(beam->node_arclength_m(k)).stretch; !(stretch > 0.0))
      throw config::UserError(
          fmt::format("{}: these loads press the needle to nothing (stretch {:.3g} at s = {:.3g} m, EA = {:.3g} N); lower them",
                      options.needle.string(), stretch, beam->node_arclength_m(k), properties.axial_n));

  file.stream() << header;
  for (std::size_t k = 0; k < beam->nodes(); ++k) {
    const double s = beam->node_arclength_m(k);
    const needle::Station at = beam->at(s);
    file.stream() << row(s, at.position_m, at.theta_rad);
  }
  file.keep();
  const needle::Station tip = beam->tip();
  const needle::Wrench base = beam->reaction();
  if (options.json)
    fmt::print("{{\"rows\": {}, {}\"bending_nm2\": {:.17g}, \"axial_n\": {:.17g}, \"iterations\": {}, \"residual_nm\": {:.3g}}}\n",
               beam->nodes(), json_of(tip.position_m, tip.theta_rad, base), properties.bending_nm2, properties.axial_n, result.iterations,
               result.residual_nm);
  else
    fmt::print("{}; {} rows, {} iterations\n", text_of(tip.position_m, tip.theta_rad, base), beam->nodes(), result.iterations);
  return 0;
}

// The fixed point as printed; where that does not converge, Newton's method on the same triangles.
int bend_triangles(const NeedleBendOptions& options, const scene::Needle& given) {
  using Status = fem::ThesisNeedle::Status;
  if (options.tip_moment_nm != 0.0)
    throw config::UserError(
        fmt::format("{}: needle.model = \"thesis\": --tip-moment {}: nodes of triangles take forces alone; leave the moment out, or write "
                    "model = \"beam\"",
                    given.where, options.tip_moment_nm));
  std::vector<fem::ThesisNeedle::Force> forces;
  for (const At& f : forces_of(options, given.length_m)) forces.push_back({f.arclength_m, f.force_n});
  config::NewFile file(options.out);
  fem::ThesisNeedle needle(scene::triangles_of(given));
  needle.set_forces(forces);
  const fem::ThesisNeedle::Result fixed = needle.fixed_point();
  const bool by_newton = fixed.status != Status::Converged;
  const fem::ThesisNeedle::Result result = by_newton ? needle.newton() : fixed;
  if (result.status == Status::Unstable)
    throw config::UserError(fmt::format("{}: needle.model = \"thesis\": the needle is unstable; {}", given.where, how_to_steady));
  if (result.status != Status::Converged)
    throw config::UserError(fmt::format(
        "{}: needle.model = \"thesis\": neither the fixed point nor Newton's method find equilibrium; Newton's stopped at {:.3g} "
        "% of the loads ({}); lower them",
        given.where, 100 * result.load_fraction, to_string(result.status)));

  file.stream() << header;
  for (int k = 0; k < needle.stations(); ++k) {
    const fem::ThesisNeedle::Station at = needle.station(k);
    file.stream() << row(at.arclength_m, at.position_m, at.theta_rad);
  }
  file.keep();
  const fem::ThesisNeedle::Station tip = needle.tip();
  const fem::ThesisNeedle::Reaction reaction = needle.reaction();
  const needle::Wrench base{reaction.fx_n, reaction.fy_n, reaction.tau_nm};
  const double young_pa = needle.properties().young_pa;
  if (options.json) {
    fmt::print(
        "{{\"rows\": {}, {}\"young_pa\": {:.17g}, \"fitted\": {}, \"method\": \"{}\", \"fixed_point\": \"{}\", "
        "\"fixed_point_iterations\": {}, \"newton_iterations\": {}, \"residual_n\": {:.3g}}}\n",
        needle.stations(), json_of(tip.position_m, tip.theta_rad, base), young_pa, !given.young_stated,
        by_newton ? "newton" : "fixed_point", to_string(fixed.status), fixed.iterations, by_newton ? result.iterations : 0,
        result.residual_n);
    return 0;
  }
  fmt::print("{}; {} rows\n", text_of(tip.position_m, tip.theta_rad, base), needle.stations());
  fmt::print("model of the thesis, {} x {} nodes, E = {:.4g} MPa ({}): ", needle.stations(), fem::ThesisNeedle::across, 1e-6 * young_pa,
             given.young_stated ? "as stated" : "fitted to the tube's compliance at small load");
  if (by_newton)
    fmt::print("the fixed point {} ({} iterations), so the shape is by Newton's method ({} iterations)\n",
               fixed.status == Status::Diverged ? "diverges" : "does not converge", fixed.iterations, result.iterations);
  else
    fmt::print("the fixed point converged in {} iterations\n", fixed.iterations);
  return 0;
}

}  // namespace

std::string wrong_numbers(const std::string& text, std::size_t count, const char* pattern) {
  if (numbers_of(text).size() == count) return {};
  return fmt::format("{}: write {}, {} finite numbers with commas between and no spaces", text, pattern, count);
}

int needle_bend(const NeedleBendOptions& options) {
  const scene::Needle needle = scene::read_needle(options.needle);
  return needle.model == scene::NeedleModel::Thesis ? bend_triangles(options, needle) : bend_beam(options, scene::beam_of(needle));
}

}  // namespace trocar::cli
