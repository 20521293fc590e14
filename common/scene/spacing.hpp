// Node coordinates along a graded axis. A node lies at `towards`; on each side of it element sizes grow by one factor from one to the next.
#pragma once

#include <vector>

namespace trocar::scene {

// from <= towards <= to, nodes >= 2 (>= 3 when towards lies inside). Empty when no such axis exists.
// Smallest: both elements at `towards` have this size, the factors (at least 1, one for each side) follow.
[[nodiscard]] std::vector<double> axis_with_smallest(double from, double to, double towards, int nodes, double smallest);
// Ratio: both sides grow by this factor, at least 1, and their smallest sizes follow.
[[nodiscard]] std::vector<double> axis_with_ratio(double from, double to, double towards, int nodes, double ratio);

// The largest factor between neighbouring elements, either way.
[[nodiscard]] double steepest(const std::vector<double>& axis);

}  // namespace trocar::scene
