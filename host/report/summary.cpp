#include <algorithm>
#include <cmath>
#include <map>

#include "host/report/haptic.hpp"
#include "host/report/report.hpp"

namespace trocar::report {

namespace {

constexpr double fit_from_m = 0.020;
constexpr double fit_to_m = 0.065;
constexpr double deepest_m = 0.0005;
constexpr double sag_window_m = 0.002;
constexpr double slice_m = 0.001;

double depth_of(const RunInfo& run, const std::array<double, 3>& pose) noexcept {
  return (pose[1] + run.needle_length_m * std::sin(pose[2]) - run.surface_y_m) / std::sin(run.needle_angle_rad);
}

double axial_error_m(const RunInfo& run, const Sample& s) noexcept {
  return along_needle(run, {s.setpoint_pose[0] - s.pose[0], s.setpoint_pose[1] - s.pose[1], 0.0});
}

class TrackingSum {
 public:
  void add(const Sample& s) noexcept {
    const double position = std::hypot(s.setpoint_pose[0] - s.pose[0], s.setpoint_pose[1] - s.pose[1]);
    const double angle = std::abs(s.setpoint_pose[2] - s.pose[2]);
    if (!std::isfinite(position) || !std::isfinite(angle)) return;  // no reference: the position was not controlled
    ++ticks_;
    square_m_ += position * position;
    square_rad_ += angle * angle;
    max_m_ = std::max(max_m_, position);
    max_rad_ = std::max(max_rad_, angle);
  }
  [[nodiscard]] Tracking result() const noexcept {
    if (ticks_ == 0) return {};
    const auto n = static_cast<double>(ticks_);
    return {ticks_, std::sqrt(square_m_ / n), max_m_, std::sqrt(square_rad_ / n), max_rad_};
  }

 private:
  std::uint64_t ticks_{};
  double square_m_{}, square_rad_{}, max_m_{}, max_rad_{};
};

Tracking tracking_of(std::span<const Sample> samples) noexcept {
  TrackingSum sum;
  for (const Sample& s : samples) sum.add(s);
  return sum.result();
}

std::optional<LineFit> fit_force(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<std::pair<double, double>> points;  // depth, force
  double deepest = 0.0;
  for (const Sample& s : samples) {
    const double depth = tip_depth_m(run, s);
    deepest = std::max(deepest, depth);
    if (depth >= fit_from_m && depth <= fit_to_m) points.emplace_back(depth, axial_force_n(run, s));
  }
  if (points.size() < 3 || deepest < fit_to_m) return std::nullopt;
  const auto n = static_cast<double>(points.size());
  double depth_mean = 0.0, force_mean = 0.0;
  for (const auto& [depth, force] : points) {
    depth_mean += depth / n;
    force_mean += force / n;
  }
  double dd = 0.0, df = 0.0;
  for (const auto& [depth, force] : points) {
    dd += (depth - depth_mean) * (depth - depth_mean);
    df += (depth - depth_mean) * (force - force_mean);
  }
  if (dd <= 0.0) return std::nullopt;
  LineFit fit{points.size(), df / dd, force_mean - df / dd * depth_mean, 0.0};
  double square = 0.0;
  for (const auto& [depth, force] : points) square += std::pow(force - fit.intercept_n - fit.slope_n_per_m * depth, 2);
  fit.residual_rms_n = std::sqrt(square / n);
  return fit;
}

double greatest_depth(const RunInfo& run, std::span<const Sample> samples) {
  double deepest = not_measured;
  for (const Sample& s : samples) deepest = std::fmax(deepest, tip_depth_m(run, s));
  return deepest;
}

template <class Value>
double mean(std::span<const Sample> samples, Value&& value) {
  double sum = 0.0;
  std::uint64_t count = 0;
  for (const Sample& s : samples) {
    const std::optional<double> v = value(s);
    if (!v) continue;
    sum += *v;
    ++count;
  }
  return count == 0 ? not_measured : sum / static_cast<double>(count);
}

double withdrawal_force(const RunInfo& run, std::span<const Sample> samples) {
  struct Slice {
    double force{};
    std::uint64_t count{};
  };
  std::map<long, Slice> slices;
  for (const Sample& s : samples) {
    const double depth = tip_depth_m(run, s);
    if (depth < 0.0) continue;
    Slice& slice = slices[std::lround(std::floor(depth / slice_m))];
    slice.force += axial_force_n(run, s);
    ++slice.count;
  }
  double least = not_measured;
  for (const auto& [index, slice] : slices) least = std::fmin(least, slice.force / static_cast<double>(slice.count));
  return least;
}

Distribution distribution(std::vector<double> values) {
  if (values.empty()) return {};
  const auto rank = [&](double p) {
    // Less a rounding error, or 0.9999 of 10000 values would be the last.
    const auto index = static_cast<std::size_t>(std::ceil(p * static_cast<double>(values.size()) - 1e-6)) - 1;
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index), values.end());
    return values[index];
  };
  return {values.size(), rank(0.50), rank(0.99), rank(0.9999), *std::ranges::max_element(values)};
}

// One count of one encoder, seen from the base: ticks in which exactly one count moved.
double median_step(std::span<const Sample> samples) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const Sample& a = samples[i - 1];
    const Sample& b = samples[i];
    if (b.tick != a.tick + 1 || a.missed_feedback != 0 || b.missed_feedback != 0) continue;
    std::int64_t counts = 0;
    for (std::size_t j = 0; j < capacity::drives; ++j) {
      counts += std::abs(std::int64_t{b.position_counts[j]} - a.position_counts[j]);
    }
    if (counts != 1) continue;
    const double step = std::hypot(b.pose[0] - a.pose[0], b.pose[1] - a.pose[1]);
    if (step > 0.0) steps.push_back(step);
  }
  return distribution(std::move(steps)).p50;
}

std::vector<Insertion> insertions_of(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<Insertion> all;
  for (std::size_t i = 0; i < run.phases.size(); ++i) {
    const Phase& phase = run.phases[i];
    if (phase.kind != Phase::Kind::Insert) continue;
    const auto in = samples_of(phase, samples);
    Insertion insertion;
    insertion.name = phase.name;
    insertion.gain_set = phase.gain_set;
    insertion.speed_m_s = phase.speed_m_s;
    insertion.depth_m = greatest_depth(run, in);
    insertion.fit = fit_force(run, in);
    insertion.full_depth_force_n = mean(in, [&](const Sample& s) -> std::optional<double> {
      if (!(insertion.depth_m > 0.0) || tip_depth_m(run, s) < insertion.depth_m - deepest_m) return std::nullopt;
      return axial_force_n(run, s);
    });
    insertion.insert = tracking_of(in);
    for (std::size_t k = i + 1; k < run.phases.size() && run.phases[k].kind != Phase::Kind::Insert; ++k) {
      const Phase& out = run.phases[k];
      if (out.kind != Phase::Kind::Withdraw || out.speed_m_s != phase.speed_m_s || out.gain_set != phase.gain_set) continue;
      insertion.withdrawal_force_n = withdrawal_force(run, samples_of(out, samples));
      insertion.withdraw = tracking_of(samples_of(out, samples));
      break;
    }
    all.push_back(std::move(insertion));
  }
  return all;
}

std::vector<GainTracking> tracking_by_gains(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<GainTracking> all;
  std::vector<std::string> names;
  for (const Phase& phase : run.phases) {
    if (std::ranges::find(names, phase.gain_set) == names.end()) names.push_back(phase.gain_set);
  }
  for (const std::string& name : names) {
    TrackingSum air, phantom;
    for (const Phase& phase : run.phases) {
      if (phase.gain_set != name) continue;
      const bool in_air = phase.kind == Phase::Kind::Air;
      const bool in_phantom = phase.kind == Phase::Kind::Insert || phase.kind == Phase::Kind::Dwell || phase.kind == Phase::Kind::Withdraw;
      if (!in_air && !in_phantom) continue;
      for (const Sample& s : samples_of(phase, samples)) (in_air ? air : phantom).add(s);
    }
    if (air.result().ticks + phantom.result().ticks > 0) all.push_back({name, air.result(), phantom.result()});
  }
  return all;
}

std::vector<Sag> sags_of(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<Sag> all;
  if (!(run.kp_n_per_m > 0.0)) return all;
  for (std::size_t i = 0; i < run.phases.size(); ++i) {
    const Phase& phase = run.phases[i];
    if (phase.gain_set != run.sag_gain_set) continue;
    auto in = samples_of(phase, samples);
    double from_depth = -std::numeric_limits<double>::infinity();
    if (phase.kind == Phase::Kind::Dwell) {
      in = in.subspan(in.size() / 2);
    } else if (phase.kind == Phase::Kind::Insert) {
      const bool dwells = i + 1 < run.phases.size() && run.phases[i + 1].kind == Phase::Kind::Dwell;
      if (dwells) continue;
      from_depth = greatest_depth(run, in) - sag_window_m;
    } else {
      continue;
    }
    const auto average = [&](auto&& value) {
      return mean(in, [&](const Sample& s) { return tip_depth_m(run, s) < from_depth ? std::nullopt : std::optional<double>(value(s)); });
    };
    Sag sag;
    sag.phase = phase.name;
    sag.force_n = average([&](const Sample& s) { return axial_force_n(run, s); });
    sag.command_n = average([&](const Sample& s) { return along_needle(run, s.wrench_command); });
    sag.error_m = average([&](const Sample& s) { return axial_error_m(run, s); });
    sag.expected_m = sag.force_n / run.kp_n_per_m;
    sag.expected_command_m = sag.command_n / run.kp_n_per_m;
    if (!std::isnan(sag.error_m)) all.push_back(std::move(sag));
  }
  return all;
}

}  // namespace

double along_needle(const RunInfo& run, const std::array<double, 3>& vector) noexcept {
  return vector[0] * std::cos(run.needle_angle_rad) + vector[1] * std::sin(run.needle_angle_rad);
}

double tip_depth_m(const RunInfo& run, const Sample& s) noexcept { return depth_of(run, s.pose); }
double virtual_depth_m(const RunInfo& run, const Sample& s) noexcept { return depth_of(run, s.virtual_pose); }

double axial_force_n(const RunInfo& run, const Sample& s) noexcept { return along_needle(run, s.base_wrench); }

std::span<const Sample> samples_of(const Phase& phase, std::span<const Sample> samples) noexcept {
  const auto first = std::ranges::lower_bound(samples, phase.first_tick, {}, &Sample::tick);
  const auto last = std::ranges::upper_bound(samples, phase.last_tick, {}, &Sample::tick);
  return first < last ? std::span(first, last) : std::span<const Sample>{};
}

std::span<const Sample> after_last_restart(std::span<const Sample> samples) noexcept {
  for (std::size_t i = samples.size(); i > 1; --i) {
    if (samples[i - 1].tick <= samples[i - 2].tick) return samples.subspan(i - 1);
  }
  return samples;
}

Summary summarise(const RunInfo& run, std::span<const Sample> all) {
  Summary summary;
  for (std::size_t i = 1; i < all.size(); ++i) summary.restarts += all[i].tick <= all[i - 1].tick ? 1u : 0u;
  const auto samples = after_last_restart(all);
  summary.samples = samples.size();
  if (!samples.empty()) summary.duration_s = 1e-9 * static_cast<double>(samples.back().time_ns - samples.front().time_ns);

  std::vector<double> tick_us, wakeup_us;
  std::uint64_t missed_in_a_row = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    if (i > 0 && s.tick - samples[i - 1].tick > 1) {
      ++summary.gaps;
      summary.lost_ticks += s.tick - samples[i - 1].tick - 1;
    }
    const bool missed = s.missed_feedback > 0 && s.mode != Mode::Off;  // drives that are off owe none
    missed_in_a_row = missed ? missed_in_a_row + 1 : 0;
    summary.ticks_without_feedback += missed ? 1u : 0u;
    summary.longest_without_feedback = std::max(summary.longest_without_feedback, missed_in_a_row);
    if (s.fault != Fault::None && std::ranges::find(summary.faults, to_string(s.fault)) == summary.faults.end()) {
      summary.faults.emplace_back(to_string(s.fault));
    }
    if (!run.lockstep) {
      tick_us.push_back(static_cast<double>(s.tick_us));
      wakeup_us.push_back(static_cast<double>(s.wakeup_late_us));
    }
  }
  summary.tick_us = distribution(std::move(tick_us));
  summary.wakeup_late_us = distribution(std::move(wakeup_us));
  if (run.kind == RunInfo::Kind::Haptic) {
    summary.displays = displays_of(run, samples);
  } else {
    summary.insertions = insertions_of(run, samples);
    summary.tracking = tracking_by_gains(run, samples);
    summary.sags = sags_of(run, samples);
  }
  summary.step_m = median_step(samples);
  return summary;
}

}  // namespace trocar::report
