#include "host/camera/stream_source.hpp"

#include <fmt/format.h>

#include <utility>

namespace trocar::camera {
namespace {

constexpr std::chrono::milliseconds patience{2'000};  // it says when it serves its camera

}  // namespace

StreamSource::StreamSource(const std::filesystem::path& socket)
    : what_(fmt::format("the simulated camera at {}", socket.string())), client_(socket, patience) {}

Source::Status StreamSource::next(optics::Frame& frame, std::chrono::milliseconds timeout) {
  switch (client_.receive(frame, timeout)) {
    case optics::FrameClient::Status::Frame:
      if (counters_.frames > 0 && frame.number > expected_) {
        counters_.lost += frame.number - expected_;
        notices_.push_back(fmt::format("frames {} to {} are lost", expected_, frame.number - 1));
      }
      expected_ = frame.number + 1;
      ++counters_.frames;
      return Status::Frame;
    case optics::FrameClient::Status::Timeout:
      return Status::Timeout;
    case optics::FrameClient::Status::Closed:
      return Status::End;
    case optics::FrameClient::Status::Broken:
      what_ += ": it ended in the middle of a frame; what came before is whole";
      return Status::Lost;
    case optics::FrameClient::Status::Foreign:
      break;
  }
  what_ += ": what it sends is no frame of this version; use programs of one build";
  return Status::Lost;
}

}  // namespace trocar::camera
