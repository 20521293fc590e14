#include "host/report/haptic.hpp"

#include <algorithm>
#include <cmath>

#include "common/insertion/insertion.hpp"

namespace trocar::report {

namespace {

constexpr double rest_m_s = 0.005;
constexpr double least_step_n = 0.5;
constexpr double rise_part = 0.9;
constexpr double steady_part = 0.2;
constexpr std::size_t step_ticks = 3, before_ticks = 50, after_ticks = 100;

class DifferenceSum {
 public:
  void add(const std::array<double, 3>& a, const std::array<double, 3>& b) noexcept {
    const double square = std::pow(a[0] - b[0], 2) + std::pow(a[1] - b[1], 2);
    if (!std::isfinite(square)) return;
    square_ += square;
    ++ticks_;
  }
  [[nodiscard]] Difference result() const noexcept {
    return {ticks_, ticks_ == 0 ? not_measured : std::sqrt(square_ / static_cast<double>(ticks_))};
  }

 private:
  double square_{};
  std::uint64_t ticks_{};
};

const Truth* truth_of(const RunInfo& run, std::uint64_t tick) noexcept {
  const auto found = std::ranges::lower_bound(run.truth, tick, {}, &Truth::tick);
  return found != run.truth.end() && found->tick == tick ? &*found : nullptr;
}

double spread(std::span<const double> values) noexcept {
  const auto [least, greatest] = std::ranges::minmax_element(values);
  return *greatest - *least;
}

}  // namespace

std::vector<Sample> felt_samples(const Phase& phase, std::span<const Sample> samples) {
  std::vector<Sample> felt;
  for (const Sample& s : samples_of(phase, samples))
    if (s.mode == Mode::Haptic) felt.push_back(s);
  return felt;
}

double observer_rise_s(const RunInfo& run, std::span<const Sample> felt) {
  std::vector<double> truth, estimate;
  for (const Sample& s : felt) {
    const Truth* t = truth_of(run, s.tick);
    if (t == nullptr) return not_measured;
    truth.push_back(along_needle(run, t->hand_wrench));
    estimate.push_back(along_needle(run, s.handle_wrench));
  }
  double most = 0.0;
  std::size_t at = 0;  // the last tick of before the step
  for (std::size_t i = before_ticks; i + after_ticks < truth.size(); ++i) {
    const double change = truth[i + step_ticks] - truth[i];
    if (std::abs(change) < least_step_n || std::abs(change) <= std::abs(most)) continue;
    const std::span all(truth);
    const double steady = steady_part * std::abs(change);
    if (spread(all.subspan(i - before_ticks, before_ticks + 1)) > steady ||
        spread(all.subspan(i + step_ticks, after_ticks - step_ticks + 1)) > steady)
      continue;
    most = change;
    at = i;
  }
  if (most == 0.0) return not_measured;
  double base = 0.0;
  for (std::size_t i = at - before_ticks; i <= at; ++i) base += estimate[i] / static_cast<double>(before_ticks + 1);
  // Counted from the last tick before the truth crosses half of its step.
  std::size_t begin = at;
  while (begin < at + step_ticks && std::abs(truth[begin + 1] - truth[at]) < 0.5 * std::abs(most)) ++begin;
  for (std::size_t i = begin; i <= at + after_ticks; ++i)
    if ((estimate[i] - base) / most >= rise_part) return 1e-9 * static_cast<double>(felt[i].time_ns - felt[begin].time_ns);
  return not_measured;
}

std::vector<HapticDisplay> displays_of(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<HapticDisplay> all;
  for (const Phase& phase : run.phases) {
    if (phase.kind != Phase::Kind::Haptic) continue;
    const std::vector<Sample> felt = felt_samples(phase, samples);
    HapticDisplay d;
    d.name = phase.name;
    d.ticks = felt.size();
    if (felt.size() > 1) d.duration_s = 1e-9 * static_cast<double>(felt.back().time_ns - felt.front().time_ns);
    DifferenceSum difference, at_rest, observer, true_difference;
    for (const Sample& s : felt) {
      d.depth_m = std::fmax(d.depth_m, virtual_depth_m(run, s));
      d.force_n = std::fmax(d.force_n, std::hypot(s.virtual_wrench[0], s.virtual_wrench[1]));
      d.least_energy_j = std::fmin(d.least_energy_j, s.display_energy_j);
      d.most_contacts = std::max(d.most_contacts, s.virtual_contacts);
      // As the controller counts them (firmware/virtual_needle).
      d.unsolved_ticks += s.virtual_status > static_cast<std::uint8_t>(insertion::Status::TipLost) ? 1u : 0u;
      difference.add(s.handle_wrench, s.virtual_wrench);
      if (std::hypot(s.velocity[0], s.velocity[1]) < rest_m_s) at_rest.add(s.handle_wrench, s.virtual_wrench);
      if (const Truth* t = truth_of(run, s.tick)) {
        observer.add(s.handle_wrench, t->hand_wrench);
        true_difference.add(t->hand_wrench, s.virtual_wrench);
      }
    }
    d.difference = difference.result();
    d.at_rest = at_rest.result();
    d.observer = observer.result();
    d.true_difference = true_difference.result();
    d.observer_rise_s = observer_rise_s(run, felt);
    all.push_back(std::move(d));
  }
  return all;
}

}  // namespace trocar::report
