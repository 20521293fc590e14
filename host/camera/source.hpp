// Where frames come from: a camera, image files, a video, or the simulated machine, behind one interface.
//   aravis[:ID]         a GigE or USB3 Vision camera, the first one found or that with this name, address or serial number
//   stream:PATH         the simulated camera of trocar-plant or trocar-bench (--camera-socket PATH)
//   FILE.avi …          a video
//   FOLDER, IMAGES…     image files; those of a folder in the order of their names
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/optics/frame.hpp"

namespace trocar::camera {

struct SourceCounters {
  std::uint64_t frames{};   // handed out
  std::uint64_t lost{};     // gaps in the camera's count, and frames that came damaged
  std::uint64_t dropped{};  // by our queue, because nobody took them in time
};

using optics::Clock;
[[nodiscard]] const char* to_string(Clock clock) noexcept;

class Source {
 public:
  enum class Status {
    Frame,    // `frame` is the next one
    Timeout,  // none within the time given; the source goes on
    End,      // no more: the last file, the end of the video, the other side has closed
    Lost,     // the camera is gone (unplugged, the simulation died); what() says which, and what to do
  };

  virtual ~Source() = default;
  // Frames in the order of their numbers; those that were lost leave a gap. Throws config::UserError for a file that is not there or has
  // another size than the first.
  [[nodiscard]] virtual Status next(optics::Frame& frame, std::chrono::milliseconds timeout) = 0;
  [[nodiscard]] virtual SourceCounters counters() const = 0;
  [[nodiscard]] virtual Clock clock() const = 0;
  [[nodiscard]] virtual std::string what() const = 0;  // one line for a person: which source; after Lost, what happened
  // What went wrong since the last call without ending the source, one line each: a damaged file, a gap.
  [[nodiscard]] virtual std::vector<std::string> notices() = 0;
};

struct SourceOptions {
  double rate_hz{30.0};                   // of files and videos; asked of a camera
  double exposure_s{};                    // asked of a camera; 0: as it is
  bool bayer{};                           // one-channel files hold a Bayer pattern (RGGB)
  std::optional<std::uint32_t> domain{};  // DDS domain of a rig, whose clock times are then on (rig_clock.hpp)
};

[[nodiscard]] std::int64_t now_ns();  // CLOCK_MONOTONIC, as Frame::arrived_ns

// What does not wait, a camera, is read into a short queue (queue.hpp). Throws config::UserError: nothing there under that name.
[[nodiscard]] std::unique_ptr<Source> open_source(const std::vector<std::string>& names, const SourceOptions& options);

}  // namespace trocar::camera
