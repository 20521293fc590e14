#include "hal/sensor/ati_net_ft.hpp"

namespace trocar::hal::ati {

CanFrame Client::request() noexcept {
  expects_ = Expects::First;
  return request_frame(base_id_);
}

bool Client::receive(const CanFrame& frame) noexcept {
  const bool first = frame.id == base_id_ + 5;
  const bool second = frame.id == base_id_ + 6;
  const bool valid = frame.length == 8 && !frame.extended && !frame.remote && !frame.error;
  const bool in_order = (first && expects_ == Expects::First) || (second && expects_ == Expects::Second);
  if (!valid || !in_order) {
    ++unexpected_;
    return false;
  }
  if (first) {
    partial_.counts[0] = load<std::int16_t>(frame, 0);
    partial_.counts[3] = load<std::int16_t>(frame, 2);
    partial_.counts[1] = load<std::int16_t>(frame, 4);
    partial_.counts[4] = load<std::int16_t>(frame, 6);
    expects_ = Expects::Second;
    return false;
  }
  partial_.counts[2] = load<std::int16_t>(frame, 0);
  partial_.counts[5] = load<std::int16_t>(frame, 2);
  partial_.status = load<std::uint16_t>(frame, 4);
  partial_.sample = load<std::uint16_t>(frame, 6);
  reading_ = partial_;
  expects_ = Expects::Nothing;
  ++readings_;
  return true;
}

}  // namespace trocar::hal::ati
