#include "hal/can/cannelloni.hpp"

#include <algorithm>

namespace trocar::hal::cannelloni {
namespace {

constexpr std::uint8_t version = 2;
constexpr std::uint8_t operation_data = 0;
constexpr std::uint32_t flag_extended = 0x8000'0000u;
constexpr std::uint32_t flag_remote = 0x4000'0000u;
constexpr std::uint32_t flag_error = 0x2000'0000u;
constexpr std::uint8_t flag_fd = 0x80;

}  // namespace

bool Writer::append(const CanFrame& frame) noexcept {
  const std::size_t data = frame.remote ? 0 : frame.length;
  if (frame.length > 8 || size_ + 5 + data > bytes_.size()) return false;
  const std::uint32_t id =
      frame.id | (frame.extended ? flag_extended : 0) | (frame.remote ? flag_remote : 0) | (frame.error ? flag_error : 0);
  for (std::uint32_t i = 0; i < 4; ++i) bytes_[size_++] = static_cast<std::uint8_t>(id >> (24 - 8 * i));
  bytes_[size_++] = frame.length;
  for (std::size_t i = 0; i < data; ++i) bytes_[size_++] = frame.data[i];
  ++count_;
  return true;
}

std::span<const std::uint8_t> Writer::finish(std::uint8_t sequence) noexcept {
  bytes_[0] = version;
  bytes_[1] = operation_data;
  bytes_[2] = sequence;
  bytes_[3] = static_cast<std::uint8_t>(count_ >> 8);
  bytes_[4] = static_cast<std::uint8_t>(count_);
  return std::span{bytes_}.first(size_);
}

bool Reader::open(std::span<const std::uint8_t> datagram) noexcept {
  left_ = 0;
  unsupported_ = 0;
  if (datagram.size() < header_bytes || datagram[0] != version || datagram[1] != operation_data) return false;
  const auto count = static_cast<std::uint32_t>((datagram[3] << 8) | datagram[4]);
  rest_ = datagram.subspan(header_bytes);
  CanFrame frame;
  std::uint32_t foreign = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Kind kind = take(frame);
    if (kind == Kind::Malformed) return false;
    if (kind == Kind::Unsupported) ++foreign;
  }
  if (!rest_.empty()) return false;
  rest_ = datagram.subspan(header_bytes);
  sequence_ = datagram[2];
  left_ = count;
  unsupported_ = foreign;
  return true;
}

bool Reader::next(CanFrame& frame) noexcept {
  while (left_ > 0) {
    --left_;
    if (take(frame) == Kind::Frame) return true;
  }
  return false;
}

Reader::Kind Reader::take(CanFrame& frame) noexcept {
  if (rest_.size() < 5) return Kind::Malformed;
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id = (id << 8) | rest_[i];
  const bool fd = (rest_[4] & flag_fd) != 0;
  const std::uint8_t length = rest_[4] & static_cast<std::uint8_t>(~flag_fd);
  const bool remote = (id & flag_remote) != 0;
  const std::size_t head = fd ? 6 : 5;
  const std::size_t data = remote ? 0 : length;
  if (length > (fd ? 64 : 8) || rest_.size() < head + data) return Kind::Malformed;
  const auto bytes = rest_.subspan(head, data);
  rest_ = rest_.subspan(head + data);
  if (fd) return Kind::Unsupported;
  frame = {};
  frame.extended = (id & flag_extended) != 0;
  frame.remote = remote;
  frame.error = (id & flag_error) != 0;
  frame.id = id & 0x1FFF'FFFFu;
  frame.length = length;
  if (!frame.extended && !frame.error && frame.id > 0x7FFu) return Kind::Malformed;
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return Kind::Frame;
}

}  // namespace trocar::hal::cannelloni
