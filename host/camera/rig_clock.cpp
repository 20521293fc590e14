#include "host/camera/rig_clock.hpp"

#include <fmt/format.h>

#include <utility>

#include "common/config/user_error.hpp"
#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"

namespace trocar::camera {
namespace {

constexpr std::uint64_t enough_batches = 25;  // half a second
constexpr std::size_t enough_frames = 8;
constexpr std::int64_t silence_ns = 2'000'000'000, patience_ns = 30'000'000'000;

}  // namespace

struct RigClock::Entities {
  explicit Entities(std::uint32_t domain) : participant(domain), samples(participant), wait(participant) { wait.add(samples.entity()); }
  wire::Participant participant;
  wire::Reader<wire::SampleBatch> samples;
  wire::WaitSet wait;
};

RigClock::RigClock(std::uint32_t domain) : domain_(domain), entities_(std::make_unique<Entities>(domain)) {
  thread_ = std::thread([this] { listen(); });
}

RigClock::~RigClock() {
  stop_.store(true);
  thread_.join();
}

void RigClock::listen() {
  constexpr std::chrono::milliseconds look_up{100};  // for the end
  while (!stop_.load()) {
    if (!entities_->wait.wait(look_up)) continue;
    const std::int64_t arrived_ns = now_ns();
    // Of several batches at once the last is the least late.
    std::int64_t newest_ns = 0;
    bool any = false;
    entities_->samples.take([&](const wire::SampleBatch& batch) {
      if (std::string problem = wire::version_problem("the rig", batch.protocol); !problem.empty()) {
        const std::lock_guard lock(mutex_);
        foreign_ = std::move(problem);
        return;
      }
      if (batch.samples._length == 0) return;
      newest_ns = batch.samples._buffer[batch.samples._length - 1].time_ns;
      any = true;
    });
    if (!any) continue;
    const std::lock_guard lock(mutex_);
    batches_ = offset_.see(newest_ns, arrived_ns) ? batches_ + 1 : 1;
    heard_ns_ = arrived_ns;
  }
}

std::optional<RigTime> RigClock::from_host(std::int64_t host_ns) const {
  const std::lock_guard lock(mutex_);
  const auto time = offset_.to_remote(host_ns);
  const auto held = offset_.estimate();
  if (batches_ < enough_batches || !time || !held) return std::nullopt;
  return RigTime{*time, held->uncertainty_ns};
}

std::optional<ClockOffset::Estimate> RigClock::estimate() const {
  const std::lock_guard lock(mutex_);
  return offset_.estimate();
}

std::uint64_t RigClock::restarts() const {
  const std::lock_guard lock(mutex_);
  return offset_.steps();
}

bool RigClock::silent() const {
  const std::lock_guard lock(mutex_);
  return heard_ns_ != 0 && now_ns() - heard_ns_ > silence_ns;
}

std::string RigClock::foreign() const {
  const std::lock_guard lock(mutex_);
  return foreign_;
}

RigTimedSource::RigTimedSource(std::unique_ptr<Source> source, std::unique_ptr<RigClock> rig)
    : source_(std::move(source)), rig_(std::move(rig)) {}

std::optional<RigTime> RigTimedSource::time_of(const optics::Frame& frame) {
  if (source_->clock() == Clock::Host) return rig_->from_host(frame.time_ns);
  if (!camera_.see(frame.time_ns, frame.arrived_ns) && frames_ > 0)
    notices_.push_back(fmt::format("frame {}: the camera's clock stepped", frame.number));
  const auto host_ns = camera_.to_local(frame.time_ns);
  const auto held = camera_.estimate();
  if (!host_ns || !held || (frames_ == 0 && passed_ < enough_frames)) return std::nullopt;
  auto time = rig_->from_host(*host_ns);
  if (time) time->uncertainty_ns += held->uncertainty_ns;
  return time;
}

Source::Status RigTimedSource::next(optics::Frame& frame, std::chrono::milliseconds timeout) {
  if (begun_ns_ == 0) begun_ns_ = now_ns();
  const Status status = source_->next(frame, timeout);
  if (status == Status::Frame) {
    if (const auto time = time_of(frame)) {
      frame.time_ns = time->time_ns;
      frame.time_uncertainty_ns = time->uncertainty_ns;
      if (frames_++ == 0) {
        const auto rig = rig_->estimate().value_or(ClockOffset::Estimate{});  // begun anew this moment: the next lines say so
        notices_.push_back(fmt::format(
            "times are the rig's from frame {} on: it began {:.6f} s after this machine's clock, which gains {:.1f} us a second; "
            "held to {:.1f} us",
            frame.number, 1e-9 * static_cast<double>(rig.offset_ns), 1e6 * rig.drift, 1e-3 * static_cast<double>(time->uncertainty_ns)));
        restarts_ = rig_->restarts();
      }
      if (const std::uint64_t restarts = rig_->restarts(); restarts != restarts_) {
        notices_.push_back(fmt::format("frame {}: the rig has begun anew, and its time with it", frame.number));
        restarts_ = restarts;
      }
      if (const bool silent = rig_->silent(); silent != silent_) {
        notices_.push_back(fmt::format("frame {}: the rig is {}", frame.number,
                                       silent ? "silent; times go on by what is known of its clock" : "heard again"));
        silent_ = silent;
      }
      return status;
    }
    ++(frames_ == 0 ? passed_ : dropped_);
  }
  if (status != Status::Frame && status != Status::Timeout) return status;
  // Another rig may speak there too: only when none of ours came.
  if (const std::string foreign = rig_->foreign(); frames_ == 0 && now_ns() - begun_ns_ > patience_ns && !foreign.empty())
    throw config::UserError(fmt::format("DDS domain {}: {}", rig_->domain(), foreign));
  if (frames_ == 0 && now_ns() - begun_ns_ > patience_ns)
    throw config::UserError(
        fmt::format("no rig is heard on DDS domain {} for {} s, so that frames have no time of it; start it, name its "
                    "domain, or leave --domain away",
                    rig_->domain(), patience_ns / 1'000'000'000));
  return Status::Timeout;
}

SourceCounters RigTimedSource::counters() const {
  SourceCounters c = source_->counters();
  c.frames = frames_;
  c.dropped += dropped_;
  return c;
}

std::vector<std::string> RigTimedSource::notices() {
  std::vector<std::string> all = source_->notices();
  for (std::string& line : std::exchange(notices_, {})) all.push_back(std::move(line));
  return all;
}

}  // namespace trocar::camera
