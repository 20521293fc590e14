// What a hand felt: a row of numbers and the figures for each Haptic phase of a run.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "host/report/report.hpp"

namespace trocar::report {

// The ticks of a Haptic phase in which the mode is Haptic.
[[nodiscard]] std::vector<Sample> felt_samples(const Phase& phase, std::span<const Sample> samples);

// Rise of the estimate to 90 % of the greatest step of the true force: a change along the needle of at least 0.5 N within 3 ms, with the
// force steady to a fifth of that for 50 ms before and 100 ms after. NaN without such a step, or when the estimate does not get there in
// 100 ms.
[[nodiscard]] double observer_rise_s(const RunInfo& run, std::span<const Sample> felt);

[[nodiscard]] std::vector<HapticDisplay> displays_of(const RunInfo& run, std::span<const Sample> samples);

}  // namespace trocar::report
