// The rig's clock, and frames on it: t_rig = t_camera + offset of the camera to this machine - offset of the rig to this machine
// (clock_offset.hpp), each held by the earliest arrivals of the last 20 s.
// The uncertainty is that of both lines. What all arrivals of one side have in common is not in it and shifts the time: exposure and
// read-out of a camera (trocar camera register finds them, as its delay), and some 0.1 ms on the way of the rig's samples.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "host/camera/clock_offset.hpp"
#include "host/camera/source.hpp"

namespace trocar::camera {

struct RigTime {
  std::int64_t time_ns{};  // as Sample.time_ns
  std::int64_t uncertainty_ns{};
};

// Reads rig/samples in a thread of its own.
class RigClock {
 public:
  explicit RigClock(std::uint32_t domain);  // throws wire::Error
  ~RigClock();
  RigClock(const RigClock&) = delete;
  RigClock& operator=(const RigClock&) = delete;

  // Nothing until some batches of samples came.
  [[nodiscard]] std::optional<RigTime> from_host(std::int64_t host_ns) const;
  [[nodiscard]] std::optional<ClockOffset::Estimate> estimate() const;
  [[nodiscard]] std::uint64_t restarts() const;  // of the controller
  [[nodiscard]] bool silent() const;             // heard once, and not for two seconds
  [[nodiscard]] std::string foreign() const;     // a rig of another protocol speaks: which; else empty
  [[nodiscard]] std::uint32_t domain() const noexcept { return domain_; }

 private:
  void listen();
  struct Entities;

  std::uint32_t domain_;
  std::unique_ptr<Entities> entities_;
  mutable std::mutex mutex_{};
  ClockOffset offset_{};
  std::uint64_t batches_{};  // since the clock last stepped
  std::int64_t heard_ns_{};
  std::string foreign_{};
  std::atomic<bool> stop_{false};
  std::thread thread_{};
};

// A camera whose frames have the rig's time. Until both clocks are known its frames are passed over; after a restart of the rig, for half a
// second, they count as dropped.
class RigTimedSource : public Source {
 public:
  RigTimedSource(std::unique_ptr<Source> source, std::unique_ptr<RigClock> rig);

  // Throws config::UserError when no rig of this protocol is heard for 30 s from the first call.
  [[nodiscard]] Status next(optics::Frame& frame, std::chrono::milliseconds timeout) override;
  [[nodiscard]] SourceCounters counters() const override;  // frames: those handed out here
  [[nodiscard]] Clock clock() const override { return Clock::Rig; }
  [[nodiscard]] std::string what() const override { return source_->what(); }
  // Also: how well the clock is held when it is known, its restarts, its silence.
  [[nodiscard]] std::vector<std::string> notices() override;

 private:
  [[nodiscard]] std::optional<RigTime> time_of(const optics::Frame& frame);

  std::unique_ptr<Source> source_;
  std::unique_ptr<RigClock> rig_;
  ClockOffset camera_{};
  std::uint64_t frames_{}, passed_{}, dropped_{}, restarts_{};
  std::int64_t begun_ns_{};
  bool silent_{};
  std::vector<std::string> notices_{};
};

}  // namespace trocar::camera
