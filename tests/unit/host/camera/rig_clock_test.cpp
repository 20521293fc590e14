#include "host/camera/rig_clock.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "common/core/contracts.hpp"
#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"

namespace trocar::camera {
namespace {

using namespace std::chrono_literals;
using Status = Source::Status;

std::uint32_t own_domain() { return 100U + static_cast<std::uint32_t>(getpid()) % 100U; }

// A controller that began at start_ns of this machine's clock and sends its samples every 5 ms.
class Rig {
 public:
  Rig(std::uint32_t domain, std::int64_t start_ns) : participant_(domain), samples_(participant_), start_ns_(start_ns) {
    thread_ = std::thread([this] { speak(); });
  }
  ~Rig() {
    stop_ = true;
    thread_.join();
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  void begin_anew(std::int64_t start_ns) { start_ns_ = start_ns; }
  void be_silent(bool on) { silent_ = on; }

 private:
  void speak() {
    wire::BatchBuffer batch;
    while (!stop_) {
      std::this_thread::sleep_for(5ms);
      if (silent_) continue;
      batch.clear();
      for (const std::int64_t earlier_ns : {1'000'000, 0}) batch.push(Sample{.time_ns = now_ns() - start_ns_ - earlier_ns});
      (void)samples_.write(batch.message(0));
    }
  }
  wire::Participant participant_;
  wire::Writer<wire::SampleBatch> samples_;
  std::atomic<std::int64_t> start_ns_;
  std::atomic<bool> stop_{false}, silent_{false};
  std::thread thread_{};
};

// Frames every 10 ms by a clock that began somewhere and runs fast by 50 ppm, in hand 2 ms after their exposure.
class Frames : public Source {
 public:
  Frames(Clock clock, std::int64_t zero_ns) : clock_(clock), zero_ns_(zero_ns) {}
  Status next(optics::Frame& frame, std::chrono::milliseconds) override {
    std::this_thread::sleep_for(10ms);
    frame.number = number_++;
    frame.arrived_ns = now_ns();
    exposed_ns_ = frame.arrived_ns - 2'000'000;
    frame.time_ns = clock_ == Clock::Host ? exposed_ns_ : static_cast<std::int64_t>(1.00005 * static_cast<double>(exposed_ns_ - zero_ns_));
    return Status::Frame;
  }
  [[nodiscard]] SourceCounters counters() const override { return {number_, 0, 0}; }
  [[nodiscard]] Clock clock() const override { return clock_; }
  [[nodiscard]] std::string what() const override { return "frames of a test"; }
  [[nodiscard]] std::vector<std::string> notices() override { return {}; }
  std::int64_t exposed_ns_{};  // of the last one, on this machine's clock

 private:
  Clock clock_;
  std::int64_t zero_ns_;
  std::uint64_t number_{};
};

struct Watched {
  explicit Watched(Clock clock) : frames(new Frames(clock, now_ns() - 700'000'000'000)) {}
  Frames* frames;
  RigTimedSource source{std::unique_ptr<Source>(frames), std::make_unique<RigClock>(own_domain())};
  optics::Frame frame{};
  std::vector<std::string> said{};

  // The next frame that comes, at most after some seconds.
  bool next() {
    for (int k = 0; k < 1000; ++k) {
      const Status status = source.next(frame, 100ms);
      for (const std::string& line : source.notices()) said.push_back(line);
      if (status == Status::Frame) return true;
    }
    return false;
  }
  [[nodiscard]] bool heard(const char* part) const {
    return std::ranges::any_of(said, [&](const std::string& line) { return line.find(part) != std::string::npos; });
  }
};

// A camera's exposure is 2 ms before its frame is in hand, which no arrival can tell; the machine's own clock needs no guess.
// Arrivals are earliest when nothing delays them; a machine that delays all of them by more than this would be needed to fail here.
constexpr double room_ns = 4e6;

TEST(RigTimedSource, FramesGetTheControllersTime) {
  for (const auto& [clock, late_ns] : {std::pair{Clock::Host, 0.0}, std::pair{Clock::Camera, 2e6}}) {
    const std::int64_t start_ns = now_ns() - 3'000'000'000;
    const Rig rig(own_domain(), start_ns);
    Watched w(clock);
    EXPECT_EQ(w.source.clock(), Clock::Rig);
    ASSERT_TRUE(w.next());
    EXPECT_TRUE(w.heard("times are the rig's from frame"));
    const std::uint64_t first = w.frame.number;
    EXPECT_GE(first, 8U);  // passed over until both clocks are known
    double nearest_ns = 1e18;
    for (int k = 0; k < 60; ++k) {
      ASSERT_TRUE(w.next());
      const double error_ns = static_cast<double>(w.frame.time_ns - (w.frames->exposed_ns_ - start_ns)) - late_ns;
      nearest_ns = std::min(nearest_ns, std::abs(error_ns));
      EXPECT_GT(w.frame.time_uncertainty_ns, 0);
    }
    EXPECT_LT(nearest_ns, room_ns);
    EXPECT_EQ(w.source.counters().frames, 61U);
  }
}

TEST(RigTimedSource, SaysWhenTheRigBeginsAnewOrFallsSilent) {
  const std::int64_t start_ns = now_ns() - 60'000'000'000;
  Rig rig(own_domain(), start_ns);
  Watched w(Clock::Host);
  ASSERT_TRUE(w.next());
  rig.be_silent(true);
  for (int k = 0; k < 400 && !w.heard("silent"); ++k) ASSERT_TRUE(w.next());  // times go on
  EXPECT_TRUE(w.heard("the rig is silent"));
  EXPECT_NEAR(static_cast<double>(w.frame.time_ns - (w.frames->exposed_ns_ - start_ns)), 0.0, room_ns);
  const std::int64_t again_ns = now_ns();
  rig.begin_anew(again_ns);
  rig.be_silent(false);
  for (int k = 0; k < 400 && !w.heard("begun anew"); ++k) ASSERT_TRUE(w.next());
  EXPECT_TRUE(w.heard("the rig has begun anew"));
  EXPECT_NEAR(static_cast<double>(w.frame.time_ns - (w.frames->exposed_ns_ - again_ns)), 0.0, 10.0 * room_ns);
  EXPECT_GT(w.source.counters().dropped, 0U);
}

}  // namespace
}  // namespace trocar::camera
