// Where frames come from: a camera, image files, a video, or the simulated machine, behind one interface.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "common/optics/frame.hpp"

namespace trocar::camera {

struct SourceCounters {
  std::uint64_t frames{};   // handed out
  std::uint64_t lost{};     // gaps in the camera's count, and frames that came damaged
  std::uint64_t dropped{};  // by our queue, because nobody took them in time
};

class Source {
 public:
  enum class Status {
    Frame,    // `frame` is the next one
    Timeout,  // none within the time given; the source goes on
    End,      // no more: the last file, the end of the video, the other side has closed
    Lost,     // the camera is gone (unplugged, the simulation died); what() says which and what to do
  };

  virtual ~Source() = default;
  // Frames in the order of their numbers. Throws config::UserError for a file that cannot be read or has another size than the first.
  [[nodiscard]] virtual Status next(optics::Frame& frame, std::chrono::milliseconds timeout) = 0;
  [[nodiscard]] virtual SourceCounters counters() const = 0;
  [[nodiscard]] virtual std::string what() const = 0;  // one line for a person: which source; after Lost, what happened
};

}  // namespace trocar::camera
