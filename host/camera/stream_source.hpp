// Frames of the simulated camera.
#pragma once

#include <filesystem>
#include <utility>

#include "common/optics/frame_stream.hpp"
#include "host/camera/source.hpp"

namespace trocar::camera {

class StreamSource : public Source {
 public:
  explicit StreamSource(const std::filesystem::path& socket);  // throws config::UserError when nobody serves it within some seconds
  Status next(optics::Frame& frame, std::chrono::milliseconds timeout) override;
  [[nodiscard]] SourceCounters counters() const override { return counters_; }
  [[nodiscard]] Clock clock() const override { return client_.clock(); }
  [[nodiscard]] std::string what() const override { return what_; }
  std::vector<std::string> notices() override { return std::exchange(notices_, {}); }

 private:
  std::string what_;
  optics::FrameClient client_;
  std::uint64_t expected_{};
  SourceCounters counters_{};
  std::vector<std::string> notices_{};
};

}  // namespace trocar::camera
