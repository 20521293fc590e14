// Expedited service data objects (CiA 301, 7.2.4.3): up to four bytes in one exchange, little-endian.
//   request to 600h + node:   2F/2B/27/23 index subindex value   download of 1/2/3/4 bytes;   40 index subindex   upload
//   answer from 580h + node:  60 download done;   4F/4B/47/43 value   upload;   80 abort code
// Objects longer than four bytes need the segmented transfer, which is not here yet: the client aborts it.
#pragma once

#include <cstdint>

#include "hal/canopen/objects.hpp"

namespace trocar::hal::canopen {

enum class SdoAbort : std::uint32_t {
  Timeout = 0x0504'0000,
  UnknownCommand = 0x0504'0001,
  WriteOnly = 0x0601'0001,
  ReadOnly = 0x0601'0002,
  NoObject = 0x0602'0000,
  NotMappable = 0x0604'0041,
  MappingTooLong = 0x0604'0042,
  WrongLength = 0x0607'0010,
  NoSubindex = 0x0609'0011,
  OutOfRange = 0x0609'0030,
  General = 0x0800'0000,
  DeviceState = 0x0800'0022,
};
[[nodiscard]] const char* to_string(SdoAbort code) noexcept;

enum class SdoKind : std::uint8_t { None, Upload, Download, Abort, Other };

// One request or one answer, decoded. `object.bytes` 0: the sender did not say how long the value is.
struct SdoMessage {
  SdoKind kind{};
  Object object{};
  std::uint32_t value{};  // of an abort: the code
};

[[nodiscard]] CanFrame sdo_download_request(std::uint8_t node, Object object, std::uint32_t value) noexcept;
[[nodiscard]] CanFrame sdo_upload_request(std::uint8_t node, Object object) noexcept;
[[nodiscard]] CanFrame sdo_abort(std::uint32_t cob, Object object, std::uint32_t code) noexcept;  // either direction
[[nodiscard]] CanFrame sdo_download_answer(std::uint8_t node, Object object) noexcept;
[[nodiscard]] CanFrame sdo_upload_answer(std::uint8_t node, Object object, std::uint32_t value) noexcept;
[[nodiscard]] SdoMessage decode_sdo_request(const CanFrame& frame) noexcept;
[[nodiscard]] SdoMessage decode_sdo_answer(const CanFrame& frame) noexcept;

// One exchange at a time with one node.
class SdoClient {
 public:
  enum class State : std::uint8_t { Idle, Waiting, Done, Aborted, TimedOut };

  explicit SdoClient(std::uint8_t node = 0) noexcept : node_{node} {}
  // Both start an exchange and return the request to send.
  [[nodiscard]] CanFrame upload(Object object, std::int64_t now_ns) noexcept;
  [[nodiscard]] CanFrame download(Object object, std::uint32_t value, std::int64_t now_ns) noexcept;
  // An answer that belongs to no open exchange, or to another object, changes nothing and returns false.
  bool receive(const CanFrame& frame) noexcept;
  // At or beyond timeout_ns since the request, a waiting exchange ends as TimedOut.
  State update(std::int64_t now_ns, std::int64_t timeout_ns) noexcept;
  void reset() noexcept { state_ = State::Idle; }

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] std::uint32_t value() const noexcept { return value_; }            // Done: of the upload
  [[nodiscard]] std::uint32_t abort_code() const noexcept { return abort_code_; }  // Aborted

 private:
  std::uint8_t node_;
  State state_{State::Idle};
  SdoKind asked_{SdoKind::None};
  Object object_{};
  std::int64_t started_ns_{};
  std::uint32_t value_{};
  std::uint32_t abort_code_{};
};

}  // namespace trocar::hal::canopen
