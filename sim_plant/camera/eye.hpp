// The camera over the phantom, served on a socket (optics/frame_stream.hpp), with the truth beside it:
//   frame,t_s,row,col,u_px,v_px,x_m,y_m,visible       of every frame that was rendered
// Eye renders and sends when it is called, as lock-step wants it. LiveEye does so in a thread of its own and costs its caller what
// Surface::take costs, once a frame.
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "common/config/new_file.hpp"
#include "common/optics/frame_stream.hpp"
#include "common/optics/simulated_camera.hpp"
#include "sim_plant/camera/camera.hpp"

namespace trocar::sim_plant {

struct EyeOptions {
  optics::SimulatedCamera camera{};
  std::filesystem::path socket{};
  std::filesystem::path truth{};  // empty: not written
  std::uint64_t seed{1};
};

class Eye {
 public:
  // Throws config::UserError, as Surface, Camera, FrameServer and NewFile do.
  Eye(const EyeOptions& options, const scene::Scene& scene, const Phantom& phantom, optics::Clock clock);

  [[nodiscard]] bool watched(std::chrono::milliseconds wait) { return server_.wait_for_client(wait); }
  // Takes the phantom as it is; then show(), from any thread.
  void take(const Phantom& phantom, std::int64_t time_ns, const std::array<double, 3>& base_pose, SurfaceState& state) {
    surface_.take(phantom, time_ns, base_pose, state);
  }
  // False: nobody got it.
  bool show(const SurfaceState& state, std::uint64_t number, std::chrono::milliseconds timeout);
  void finish();  // the truth is whole
  [[nodiscard]] std::uint64_t sent() const noexcept { return server_.sent(); }

 private:
  optics::MarkerGrid grid_;
  Surface surface_;
  Camera camera_;
  optics::FrameServer server_;
  std::optional<config::NewFile> truth_{};
  optics::Frame frame_{};
};

// Frames at the camera's rate, by the caller's time. One that is due while the last is still in work is skipped, as one that a watcher
// would miss: its number is a gap.
class LiveEye {
 public:
  LiveEye(const EyeOptions& options, const scene::Scene& scene, const Phantom& phantom);
  ~LiveEye();
  LiveEye(const LiveEye&) = delete;
  LiveEye& operator=(const LiveEye&) = delete;

  // host_ns: CLOCK_MONOTONIC, which is also the frames' clock.
  void look(const Phantom& phantom, const std::array<double, 3>& base_pose, std::int64_t host_ns);
  void finish();
  [[nodiscard]] std::uint64_t sent() const noexcept { return eye_.sent(); }  // after finish()
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }  // after finish(): why the camera ended early, if it did

 private:
  void work();

  Eye eye_;
  double rate_hz_;
  std::int64_t begun_ns_{};
  std::uint64_t next_{}, skipped_{};
  SurfaceState taken_{};  // by look(), while `ready_` is false
  std::uint64_t number_{};
  std::mutex mutex_{};
  std::condition_variable wake_{};
  bool ready_{}, stop_{};
  std::string problem_{};
  std::thread thread_{};
};

}  // namespace trocar::sim_plant
