// Takes the chatter of one count out of a position before velocities and accelerations are formed: the output stays while the input is
// within half a step of it, as play of one step does. At rest on the edge between two counts the velocity is then zero, where each flip
// would otherwise disturb it by bandwidth / e counts: that times any damping is a limit cycle by itself. Not for a spring: one that saw
// the play would lag by it, and a lagging spring feeds energy in.
#pragma once

#include <algorithm>

namespace trocar::control {

// step >= 0: one count and a little, in units of `position`. `held` starts at the first position.
[[nodiscard]] inline double hysteresis(double held, double position, double step) noexcept {
  return std::clamp(held, position - 0.5 * step, position + 0.5 * step);
}

}  // namespace trocar::control
