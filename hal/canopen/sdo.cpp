#include "hal/canopen/sdo.hpp"

#include <algorithm>

namespace trocar::hal::canopen {
namespace {

CanFrame sdo_frame(std::uint32_t cob, std::uint8_t command, Object object, std::uint32_t value) noexcept {
  CanFrame frame{.id = cob, .length = 8};
  frame.data[0] = command;
  store(frame, 1, object.index);
  store(frame, 3, object.subindex);
  store(frame, 4, value);
  return frame;
}

// Bits 2-3: how many of the four data bytes are unused; bit 1: expedited; bit 0: their number is stated.
constexpr std::uint8_t expedited(std::uint8_t command, std::uint8_t bytes) noexcept {
  return static_cast<std::uint8_t>(command | ((4 - bytes) << 2) | 3);
}

constexpr std::uint32_t keep(std::uint32_t value, std::uint8_t bytes) noexcept {
  return bytes == 0 || bytes >= 4 ? value : value & ((1u << (8u * bytes)) - 1u);
}

constexpr std::uint8_t stated_bytes(std::uint8_t command) noexcept {
  return (command & 1) != 0 ? static_cast<std::uint8_t>(4 - ((command >> 2) & 3)) : std::uint8_t{0};
}

SdoMessage decode(const CanFrame& frame, std::uint8_t upload, std::uint8_t download, std::uint8_t carrier) noexcept {
  SdoMessage message;
  if (frame.length != 8 || frame.remote || frame.error) return message;
  const std::uint8_t command = frame.data[0];
  message.object = {load<std::uint16_t>(frame, 1), frame.data[3], 0};
  const auto specifier = static_cast<std::uint8_t>(command & 0xE0);
  message.kind = SdoKind::Other;
  if (specifier == 0x80) {
    message.kind = SdoKind::Abort;
    message.value = load<std::uint32_t>(frame, 4);
  } else if (specifier == carrier) {
    if ((command & 2) == 0) return message;  // segmented
    message.kind = carrier == upload ? SdoKind::Upload : SdoKind::Download;
    message.object.bytes = stated_bytes(command);
    message.value = keep(load<std::uint32_t>(frame, 4), message.object.bytes);
  } else if (specifier == upload) {
    message.kind = SdoKind::Upload;
  } else if (specifier == download) {
    message.kind = SdoKind::Download;
  }
  return message;
}

}  // namespace

const char* to_string(SdoAbort code) noexcept {
  switch (code) {
    case SdoAbort::ToggleBit:
      return "toggle bit not alternated";
    case SdoAbort::Timeout:
      return "SDO timed out";
    case SdoAbort::UnknownCommand:
      return "unknown SDO command";
    case SdoAbort::OutOfMemory:
      return "out of memory";
    case SdoAbort::WriteOnly:
      return "object is write-only";
    case SdoAbort::ReadOnly:
      return "object is read-only";
    case SdoAbort::NoObject:
      return "object does not exist";
    case SdoAbort::NotMappable:
      return "object cannot be mapped";
    case SdoAbort::MappingTooLong:
      return "mapping is longer than a frame";
    case SdoAbort::WrongLength:
      return "wrong length";
    case SdoAbort::TooLong:
      return "value too long";
    case SdoAbort::TooShort:
      return "value too short";
    case SdoAbort::NoSubindex:
      return "subindex does not exist";
    case SdoAbort::OutOfRange:
      return "value out of range";
    case SdoAbort::General:
      return "general error";
    case SdoAbort::DeviceState:
      return "not possible in the present device state";
    case SdoAbort::NoData:
      return "no data available";
  }
  return "abort code of CiA 301";
}

CanFrame sdo_download_request(std::uint8_t node, Object object, std::uint32_t value) noexcept {
  return sdo_frame(cob_sdo_request(node), expedited(0x20, object.bytes), object, keep(value, object.bytes));
}
CanFrame sdo_upload_request(std::uint8_t node, Object object) noexcept { return sdo_frame(cob_sdo_request(node), 0x40, object, 0); }
CanFrame sdo_abort(std::uint32_t cob, Object object, std::uint32_t code) noexcept { return sdo_frame(cob, 0x80, object, code); }
CanFrame sdo_download_answer(std::uint8_t node, Object object) noexcept { return sdo_frame(cob_sdo_response(node), 0x60, object, 0); }
CanFrame sdo_upload_answer(std::uint8_t node, Object object, std::uint32_t value) noexcept {
  return sdo_frame(cob_sdo_response(node), expedited(0x40, object.bytes), object, keep(value, object.bytes));
}

CanFrame sdo_segmented_download_request(std::uint8_t node, Object object, std::uint32_t bytes) noexcept {
  return sdo_frame(cob_sdo_request(node), 0x21, object, bytes);
}
CanFrame sdo_segmented_upload_answer(std::uint8_t node, Object object, std::uint32_t bytes) noexcept {
  return sdo_frame(cob_sdo_response(node), 0x41, object, bytes);
}
CanFrame sdo_segment(std::uint32_t cob, std::uint8_t toggle, std::span<const std::uint8_t> data, bool last) noexcept {
  CanFrame frame{.id = cob, .length = 8};
  frame.data[0] = static_cast<std::uint8_t>(toggle | ((sdo_segment_bytes - data.size()) << 1) | (last ? 1u : 0u));
  std::copy(data.begin(), data.end(), frame.data.begin() + 1);
  return frame;
}
CanFrame sdo_segment_command(std::uint32_t cob, std::uint8_t command) noexcept {
  CanFrame frame{.id = cob, .length = 8};
  frame.data[0] = command;
  return frame;
}

SdoMessage decode_sdo_request(const CanFrame& frame) noexcept { return decode(frame, 0x40, 0xFF, 0x20); }
SdoMessage decode_sdo_answer(const CanFrame& frame) noexcept { return decode(frame, 0x40, 0x60, 0x40); }

void SdoClient::start(SdoKind kind, Object object, std::int64_t now_ns) noexcept {
  object_ = object;
  asked_ = kind;
  started_ns_ = now_ns;
  state_ = State::Waiting;
  segmented_ = in_segments_ = has_outgoing_ = false;
  toggle_ = 0;
  size_ = sent_ = 0;
}

CanFrame SdoClient::upload(Object object, std::int64_t now_ns) noexcept {
  start(SdoKind::Upload, object, now_ns);
  return sdo_upload_request(node_, object);
}

CanFrame SdoClient::download(Object object, std::uint32_t value, std::int64_t now_ns) noexcept {
  start(SdoKind::Download, object, now_ns);
  return sdo_download_request(node_, object, value);
}

CanFrame SdoClient::download(Object object, std::span<const std::uint8_t> data, std::int64_t now_ns) noexcept {
  start(SdoKind::Download, object, now_ns);
  size_ = std::min(data.size(), capacity);
  std::copy_n(data.begin(), size_, data_.begin());
  segmented_ = size_ == 0 || size_ > 4;
  if (segmented_) return sdo_segmented_download_request(node_, object, static_cast<std::uint32_t>(size_));
  object_.bytes = static_cast<std::uint8_t>(size_);
  return sdo_download_request(node_, object_, value());
}

std::uint32_t SdoClient::value() const noexcept {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(size_, 4); ++i) bits |= std::uint32_t{data_[i]} << (8 * i);
  return bits;
}

void SdoClient::put(const CanFrame& frame) noexcept {
  outgoing_ = frame;
  has_outgoing_ = true;
}

void SdoClient::put_download_segment() noexcept {
  const std::size_t bytes = std::min(sdo_segment_bytes, size_ - sent_);
  const auto part = data().subspan(sent_, bytes);
  sent_ += bytes;
  put(sdo_segment(cob_sdo_request(node_), toggle_, part, sent_ == size_));
}

bool SdoClient::next_frame(CanFrame& frame, std::int64_t now_ns) noexcept {
  if (!has_outgoing_) return false;
  has_outgoing_ = false;
  started_ns_ = now_ns;
  frame = outgoing_;
  return true;
}

void SdoClient::reset() noexcept {
  if (state_ == State::Waiting) has_outgoing_ = false;
  state_ = State::Idle;
}

void SdoClient::fail(SdoAbort code) noexcept {
  state_ = State::Aborted;
  abort_code_ = static_cast<std::uint32_t>(code);
  put(sdo_abort(cob_sdo_request(node_), object_, abort_code_));
}

bool SdoClient::receive(const CanFrame& frame) noexcept {
  if (state_ != State::Waiting || has_outgoing_ || frame.id != cob_sdo_response(node_)) return false;
  const SdoMessage answer = decode_sdo_answer(frame);
  if (answer.kind == SdoKind::None) return false;
  if (!in_segments_ && !(answer.object == object_)) return false;  // a segment does not name its object
  if (answer.kind == SdoKind::Abort) {
    state_ = State::Aborted;
    abort_code_ = answer.value;
  } else if (in_segments_) {
    segment_answered(frame);
  } else {
    initiated(frame);
  }
  return true;
}

void SdoClient::initiated(const CanFrame& answer) noexcept {
  const std::uint8_t command = answer.data[0];
  if (asked_ == SdoKind::Download) {
    if ((command & 0xE0) != 0x60) return fail(SdoAbort::UnknownCommand);
    in_segments_ = segmented_;
    if (!segmented_) state_ = State::Done;
    if (segmented_) put_download_segment();
    return;
  }
  if ((command & 0xE0) != 0x40) return fail(SdoAbort::UnknownCommand);
  const bool is_expedited = (command & 2) != 0;
  size_stated_ = (command & 1) != 0;
  stated_size_ = is_expedited ? stated_bytes(command) : load<std::uint32_t>(answer, 4);
  if (size_stated_ && object_.bytes != 0 && stated_size_ != object_.bytes) return fail(SdoAbort::WrongLength);
  if (is_expedited) {
    const std::uint8_t unstated = object_.bytes != 0 ? object_.bytes : std::uint8_t{4};
    size_ = size_stated_ ? stated_size_ : unstated;
    std::copy_n(answer.data.begin() + 4, size_, data_.begin());
    state_ = State::Done;
    return;
  }
  if (size_stated_ && stated_size_ > capacity) return fail(SdoAbort::OutOfMemory);
  in_segments_ = true;
  put(sdo_segment_command(cob_sdo_request(node_), 0x60));
}

void SdoClient::segment_answered(const CanFrame& answer) noexcept {
  const std::uint8_t command = answer.data[0];
  const std::uint8_t expected = asked_ == SdoKind::Upload ? 0x00 : 0x20;
  if ((command & 0xE0) != expected) return fail(SdoAbort::UnknownCommand);
  if ((command & sdo_toggle) != toggle_) return fail(SdoAbort::ToggleBit);
  toggle_ ^= sdo_toggle;
  if (asked_ == SdoKind::Download) {
    if (sent_ == size_)
      state_ = State::Done;
    else
      put_download_segment();
    return;
  }
  const std::size_t bytes = sdo_bytes_of_segment(answer);
  if (size_ + bytes > capacity) return fail(SdoAbort::OutOfMemory);
  std::copy_n(answer.data.begin() + 1, bytes, data_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += bytes;
  const bool last = (command & 1) != 0;
  if (size_stated_ && size_ > stated_size_) return fail(SdoAbort::TooLong);
  if (!last) return put(sdo_segment_command(cob_sdo_request(node_), static_cast<std::uint8_t>(0x60 | toggle_)));
  if (size_stated_ && size_ < stated_size_) return fail(SdoAbort::TooShort);
  if (object_.bytes != 0 && size_ != object_.bytes) return fail(SdoAbort::WrongLength);
  state_ = State::Done;
}

SdoClient::State SdoClient::update(std::int64_t now_ns, std::int64_t timeout_ns) noexcept {
  // A request that still waits for its turn on the bus is not the node's delay.
  if (state_ == State::Waiting && !has_outgoing_ && now_ns - started_ns_ >= timeout_ns) {
    fail(SdoAbort::Timeout);
    state_ = State::TimedOut;
  }
  return state_;
}

}  // namespace trocar::hal::canopen
