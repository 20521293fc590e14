// Takes values from the front of an input; beyond its end everything is zero.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "hal/can/frame.hpp"

namespace trocar::fuzz {

class ByteSource {
 public:
  ByteSource(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  template <class T>
  T take() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    const std::size_t bytes = std::min(sizeof value, rest_.size());
    if (bytes != 0) std::memcpy(&value, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
    return value;
  }
  void fill(std::span<std::uint8_t> out) {
    for (std::uint8_t& byte : out) byte = take<std::uint8_t>();
  }

  // A frame as a receiver may see it: 14 bytes. The identifier is near those that the rig uses, so that few executions end at an address.
  hal::CanFrame frame() {
    hal::CanFrame frame;
    const auto flags = take<std::uint8_t>();
    frame.id = take<std::uint32_t>() & ((flags & 1) != 0 ? 0x1FFF'FFFFu : 0x7FFu);
    frame.length = static_cast<std::uint8_t>((flags >> 4) > 8 ? 8 : flags >> 4);
    frame.extended = (flags & 1) != 0;
    frame.remote = (flags & 2) != 0;
    frame.error = (flags & 4) != 0;
    fill(frame.data);
    return frame;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace trocar::fuzz
