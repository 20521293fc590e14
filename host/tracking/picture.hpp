// A frame with its markers drawn in, as the thesis's figures 3.5 and 3.7.
#pragma once

#include <filesystem>
#include <span>

#include "common/optics/frame.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {

// A cross on each valid marker, and an arrow `scale` times as long as its way from `rest` where that is longer than a pixel. A lost one has
// no cross. PNG; false when it cannot be written.
[[nodiscard]] bool draw_markers(const optics::Frame& frame, std::span<const Place> rest, std::span<const Marker> markers, double scale,
                                const std::filesystem::path& file);

}  // namespace trocar::tracking
