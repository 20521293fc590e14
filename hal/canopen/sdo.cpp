#include "hal/canopen/sdo.hpp"

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
    case SdoAbort::Timeout:
      return "SDO timed out";
    case SdoAbort::UnknownCommand:
      return "unknown SDO command";
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
    case SdoAbort::NoSubindex:
      return "subindex does not exist";
    case SdoAbort::OutOfRange:
      return "value out of range";
    case SdoAbort::General:
      return "general error";
    case SdoAbort::DeviceState:
      return "not possible in the present device state";
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

SdoMessage decode_sdo_request(const CanFrame& frame) noexcept { return decode(frame, 0x40, 0xFF, 0x20); }
SdoMessage decode_sdo_answer(const CanFrame& frame) noexcept { return decode(frame, 0x40, 0x60, 0x40); }

CanFrame SdoClient::upload(Object object, std::int64_t now_ns) noexcept {
  object_ = object;
  asked_ = SdoKind::Upload;
  started_ns_ = now_ns;
  state_ = State::Waiting;
  return sdo_upload_request(node_, object);
}

CanFrame SdoClient::download(Object object, std::uint32_t value, std::int64_t now_ns) noexcept {
  object_ = object;
  asked_ = SdoKind::Download;
  started_ns_ = now_ns;
  state_ = State::Waiting;
  return sdo_download_request(node_, object, value);
}

bool SdoClient::receive(const CanFrame& frame) noexcept {
  if (state_ != State::Waiting || frame.id != cob_sdo_response(node_)) return false;
  const SdoMessage answer = decode_sdo_answer(frame);
  if (!(answer.object == object_)) return false;
  if (answer.kind == asked_) {
    const bool wrong_length = asked_ == SdoKind::Upload && answer.object.bytes != 0 && answer.object.bytes != object_.bytes;
    state_ = wrong_length ? State::Aborted : State::Done;
    if (wrong_length) abort_code_ = static_cast<std::uint32_t>(SdoAbort::WrongLength);
    value_ = keep(answer.value, object_.bytes);
    return true;
  }
  if (answer.kind == SdoKind::None) return false;
  state_ = State::Aborted;
  abort_code_ = answer.kind == SdoKind::Abort ? answer.value : static_cast<std::uint32_t>(SdoAbort::UnknownCommand);
  return true;
}

SdoClient::State SdoClient::update(std::int64_t now_ns, std::int64_t timeout_ns) noexcept {
  if (state_ == State::Waiting && now_ns - started_ns_ >= timeout_ns) state_ = State::TimedOut;
  return state_;
}

}  // namespace trocar::hal::canopen
