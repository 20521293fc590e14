#include "sim_plant/nodes/sensor_node.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::sim_plant {
namespace {

constexpr std::uint8_t request_short = 0x02;
constexpr std::uint16_t status_error = 0x8000;
constexpr std::uint16_t status_saturated = 0x0002;
constexpr std::int64_t sample_period_ns = 1'000'000'000 / 7000;  // the sensor's own rate: 7 kHz

}  // namespace

SensorNodeConfig make_sensor_config(const rig::Rig& rig) noexcept {
  return {.base_id = rig.buses.sensor_base_id, .counts_per_n = rig.sensor.counts_per_n, .counts_per_nm = rig.sensor.counts_per_nm};
}

void SensorNode::set_wrench(const std::array<double, 6>& force_torque) noexcept {
  status_ = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    const double counts = std::round(force_torque[i] * (i < 3 ? config_.counts_per_n : config_.counts_per_nm));
    if (std::isnan(counts)) {
      counts_[i] = 0;
      status_ |= status_error;
      continue;
    }
    const double limited = std::clamp(counts, -32768.0, 32767.0);
    if (limited != counts) status_ |= status_error | status_saturated;
    counts_[i] = static_cast<std::int16_t>(limited);
  }
}

void SensorNode::receive(const hal::CanFrame& frame, std::int64_t now_ns) noexcept {
  if (frame.id != config_.base_id || frame.extended || frame.remote || frame.error || frame.length != 1 || frame.data[0] != request_short)
    return;
  ++requests_;
  outgoing_.clear();  // a new request ends the transmission of the old one
  hal::CanFrame first{.id = config_.base_id + 5, .length = 8};
  hal::store(first, 0, counts_[0]);
  hal::store(first, 2, counts_[3]);
  hal::store(first, 4, counts_[1]);
  hal::store(first, 6, counts_[4]);
  hal::CanFrame second{.id = config_.base_id + 6, .length = 8};
  hal::store(second, 0, counts_[2]);
  hal::store(second, 2, counts_[5]);
  hal::store(second, 4, status_);
  hal::store(second, 6, static_cast<std::uint16_t>(now_ns / sample_period_ns));
  [[maybe_unused]] const bool fits = outgoing_.push(first) && outgoing_.push(second);
}

}  // namespace trocar::sim_plant
