// Frames from one process to another on the same machine, over a Unix-domain socket: how the simulated camera is plugged in.
// To whoever connects: 8 bytes "trcamer1", then little endian u32 clock (optics::Clock) and u32 0. Then frames: 8 bytes "trframe1", u64
// number, i64 time_ns, u32 width_px, u32 height_px, u32 format, u32 bytes, then the pixels. The server goes on without a client; a client
// that joins later gets what comes from then on.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/optics/frame.hpp"

namespace trocar::optics {

inline constexpr std::uint32_t largest_side_px = 16384;

class FrameServer {
 public:
  // Listens; the socket is the user's alone (0600), and removed at the end. One that a dead server left is replaced. Throws
  // config::UserError: a name that is too long or cannot be made, somebody else listening there.
  FrameServer(std::filesystem::path path, Clock clock);
  ~FrameServer();
  FrameServer(const FrameServer&) = delete;
  FrameServer& operator=(const FrameServer&) = delete;

  // Waits until a client is there; false when none came.
  [[nodiscard]] bool wait_for_client(std::chrono::milliseconds timeout);
  // Sends a whole frame, or drops the client: half a frame is none. At most `timeout` for all of it. False when nobody got it. A client
  // that waits is taken first. Call it from a thread that may wait.
  bool send(const Frame& frame, std::chrono::milliseconds timeout);
  [[nodiscard]] std::uint64_t sent() const noexcept { return sent_; }

 private:
  std::filesystem::path path_;
  Clock clock_;
  int listener_{-1}, client_{-1};
  std::uint64_t sent_{};
};

class FrameClient {
 public:
  enum class Status {
    Frame,
    Timeout,  // nothing, or not all of a frame yet: call again
    Closed,   // the server ended between two frames
    Broken,   // it ended within one
    Foreign,  // what came is no frame of this version
  };

  // Connects, waiting for the server and its greeting for at most `timeout`. Throws config::UserError when there is none, or another
  // watcher.
  FrameClient(const std::filesystem::path& path, std::chrono::milliseconds timeout);
  ~FrameClient();
  FrameClient(const FrameClient&) = delete;
  FrameClient& operator=(const FrameClient&) = delete;

  [[nodiscard]] Status receive(Frame& frame, std::chrono::milliseconds timeout);
  [[nodiscard]] Clock clock() const noexcept { return clock_; }

 private:
  int socket_{-1};
  Clock clock_{};
  std::vector<std::byte> head_{};
  std::vector<std::uint8_t> pixels_{};
  std::size_t have_{};  // bytes of the head, then of the pixels
  Frame next_{};
};

}  // namespace trocar::optics
