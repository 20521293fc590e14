// A source read by a thread of its own into a short queue, so that a slow taker costs old frames and never stops the camera.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include "host/camera/source.hpp"

namespace trocar::camera {

class QueuedSource : public Source {
 public:
  // Frames wait in a queue of `depth`; when it is full the oldest is dropped, counted, and said in notices(). The buffers go round.
  QueuedSource(std::unique_ptr<Source> source, std::size_t depth);
  ~QueuedSource() override;
  QueuedSource(const QueuedSource&) = delete;
  QueuedSource& operator=(const QueuedSource&) = delete;

  Status next(optics::Frame& frame,
              std::chrono::milliseconds timeout) override;  // what the source threw comes out here, after its last frame
  [[nodiscard]] SourceCounters counters() const override;
  [[nodiscard]] Clock clock() const override { return clock_; }
  [[nodiscard]] std::string what() const override;
  std::vector<std::string> notices() override;

 private:
  void read();

  std::unique_ptr<Source> source_;
  std::size_t depth_;
  Clock clock_;
  mutable std::mutex mutex_{};
  std::condition_variable arrived_{};
  std::deque<optics::Frame> queue_{};
  std::vector<optics::Frame> spare_{};
  std::uint64_t taken_{}, dropped_{};
  SourceCounters inner_{};
  std::string what_{};
  std::vector<std::string> notices_{};
  Status end_{Status::Frame};  // End or Lost once the source is
  std::exception_ptr error_{};
  bool stop_{};
  std::thread thread_{};
};

}  // namespace trocar::camera
