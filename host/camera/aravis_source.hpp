// GigE Vision and USB3 Vision cameras, by Aravis.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/camera/source.hpp"

namespace trocar::camera {

struct FoundCamera {
  std::string id{}, vendor{}, model{}, serial{}, address{}, protocol{};
};
[[nodiscard]] std::vector<FoundCamera> list_cameras();

// `name`: id, address or serial number; empty: the first camera found. Takes Mono8, BayerRG8 or RGB8, whichever of them the camera has, in
// this order unless it is set to one of them already. Its own time stamps; one of 0 is replaced by the host's time of arrival.
// Throws config::UserError: no such camera (with those that there are), held by another program, no format that is known here.
[[nodiscard]] std::unique_ptr<Source> open_aravis(const std::string& name, const SourceOptions& options);

}  // namespace trocar::camera
