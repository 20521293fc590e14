// Markers on DDS, topic camera/markers (common/wire/rig.idl): a message a frame.
#pragma once

#include <cstdint>
#include <memory>

#include "common/optics/marker_grid.hpp"
#include "host/tracking/track_command.hpp"

namespace trocar::tracking {

class Publisher {
 public:
  Publisher(std::uint32_t domain, const optics::MarkerGrid& grid);  // throws wire::Error
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;
  void publish(const TrackedFrame& frame);

 private:
  struct Entities;
  std::unique_ptr<Entities> entities_;
};

}  // namespace trocar::tracking
