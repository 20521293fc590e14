#include "sim_plant/camera/eye.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <exception>

namespace trocar::sim_plant {

Eye::Eye(const EyeOptions& options, const scene::Scene& scene, const Phantom& phantom, optics::Clock clock)
    : grid_(options.camera.grid),
      surface_(phantom, scene, grid_),
      camera_(options.camera, surface_.origin_m(), scene.needle.value().length_m, options.seed),
      server_(options.socket, clock) {
  if (options.truth.empty()) return;
  truth_.emplace(options.truth);
  truth_->stream() << "frame,t_s,row,col,u_px,v_px,x_m,y_m,visible\n";
}

bool Eye::show(const SurfaceState& state, std::uint64_t number, std::chrono::milliseconds timeout) {
  camera_.render(state, number, frame_);
  const bool got = server_.send(frame_, timeout);
  if (!truth_) return got;
  for (int row = 0; row < grid_.rows; ++row) {
    for (int column = 0; column < grid_.columns; ++column) {
      const optics::MarkerTruth& m = camera_.truth()[grid_.index(row, column)];
      truth_->stream() << fmt::format("{},{},{},{},{},{},{},{},{}\n", number, 1e-9 * static_cast<double>(state.time_ns), row, column,
                                      m.pixel.u_px, m.pixel.v_px, m.at.x_m, m.at.y_m, m.visible ? 1 : 0);
    }
  }
  return got;
}

void Eye::finish() {
  if (truth_) truth_->keep();
}

LiveEye::LiveEye(const EyeOptions& options, const scene::Scene& scene, const Phantom& phantom)
    : eye_(options, scene, phantom, optics::Clock::Host), rate_hz_(options.camera.rate_hz) {
  thread_ = std::thread([this] { work(); });
}

LiveEye::~LiveEye() { finish(); }

void LiveEye::look(const Phantom& phantom, const std::array<double, 3>& base_pose, std::int64_t host_ns) {
  if (next_ == 0) begun_ns_ = host_ns;
  if (static_cast<double>(host_ns - begun_ns_) < 1e9 * static_cast<double>(next_) / rate_hz_) return;
  const std::uint64_t number = next_++;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || ready_) {
    ++skipped_;
    return;
  }
  eye_.take(phantom, host_ns, base_pose, taken_);
  number_ = number;
  ready_ = true;
  wake_.notify_one();
}

void LiveEye::work() {
  // What is simulated in real time goes first: the machine that this camera looks at.
  constexpr int low = 10;
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), low);
  constexpr std::chrono::milliseconds patience{200};
  SurfaceState state;
  try {
    while (true) {
      std::uint64_t number = 0;
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, [this] { return ready_ || stop_; });
        if (stop_) return;
        std::swap(state, taken_);
        number = number_;
      }
      if (eye_.watched(std::chrono::milliseconds(0))) eye_.show(state, number, patience);
      const std::lock_guard lock(mutex_);
      ready_ = false;
    }
  } catch (const std::exception& e) {  // the truth's disk is full: the machine goes on
    problem_ = e.what();
  }
}

void LiveEye::finish() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
  if (problem_.empty()) eye_.finish();
}

}  // namespace trocar::sim_plant
