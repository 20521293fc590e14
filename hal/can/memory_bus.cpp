#include "hal/can/memory_bus.hpp"

#include <algorithm>
#include <limits>

#include "hal/can/bits.hpp"

namespace trocar::hal {
namespace {

// The bits in the order in which they fight for the bus: a zero (dominant) wins.
constexpr std::uint32_t arbitration_field(const CanFrame& frame) noexcept {
  const std::uint32_t remote = frame.remote ? 1 : 0;
  if (!frame.extended) return ((frame.id & 0x7FFu) << 21) | (remote << 20);
  return ((frame.id >> 18) << 21) | (3u << 19) | ((frame.id & 0x3FFFFu) << 1) | remote;
}

}  // namespace

bool MemoryPort::send(const CanFrame& frame, std::int64_t now_ns) noexcept {
  const bool valid = frame.length <= 8 && !frame.error && frame.id <= (frame.extended ? 0x1FFFFFFFu : 0x7FFu);
  if (!valid || !pending_.push({frame, std::max(now_ns, bus_->advanced_to_ns_)})) {
    ++counters_.send_dropped;
    return false;
  }
  ++counters_.sent;
  return true;
}

bool MemoryPort::receive(CanFrame& frame, std::int64_t now_ns) noexcept {
  bus_->advance(now_ns);
  if (!received_.pop(frame)) return false;
  count_received(counters_, frame);
  return true;
}

MemoryBus::MemoryBus(std::uint32_t bitrate_bps) noexcept : bitrate_bps_{bitrate_bps} {
  for (MemoryPort& port : ports_) port.bus_ = this;
}

MemoryPort& MemoryBus::port(std::size_t index) noexcept {
  ports_[index].attached_ = true;
  return ports_[index];
}

std::int64_t MemoryBus::duration_ns(std::uint32_t bits) const noexcept {
  return static_cast<std::int64_t>(bits) * 1'000'000'000 / static_cast<std::int64_t>(bitrate_bps_);
}

void MemoryBus::advance(std::int64_t now_ns) noexcept {
  advanced_to_ns_ = std::max(advanced_to_ns_, now_ns);
  for (;;) {
    if (in_flight_) {
      if (delivery_ns_ > advanced_to_ns_) return;
      flying_.stamp_ns = delivery_ns_;
      for (std::size_t i = 0; i < ports; ++i) {
        if (i == sender_ || !ports_[i].attached_) continue;
        if (!ports_[i].received_.push(flying_)) ++ports_[i].counters_.receive_dropped;
      }
      in_flight_ = false;
    }
    std::int64_t earliest_ns = std::numeric_limits<std::int64_t>::max();
    for (const MemoryPort& port : ports_)
      if (!port.pending_.empty()) earliest_ns = std::min(earliest_ns, port.pending_.front().ready_ns);
    const std::int64_t start_ns = std::max(idle_from_ns_, earliest_ns);
    if (start_ns >= advanced_to_ns_) return;

    std::uint32_t lowest = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t i = 0; i < ports; ++i) {
      if (ports_[i].pending_.empty() || ports_[i].pending_.front().ready_ns > start_ns) continue;
      const std::uint32_t field = arbitration_field(ports_[i].pending_.front().frame);
      if (field < lowest) {
        lowest = field;
        sender_ = i;
      }
    }
    flying_ = ports_[sender_].pending_.front().frame;
    ports_[sender_].pending_.drop_front();
    const std::uint32_t bits = can_bits(flying_);
    delivery_ns_ = start_ns + duration_ns(bits - intermission_bits);
    idle_from_ns_ = start_ns + duration_ns(bits);
    busy_ns_ += duration_ns(bits);
    in_flight_ = true;
  }
}

}  // namespace trocar::hal
