// Service data objects (CiA 301, 7.2.4.3), little-endian. Expedited: up to four bytes in one exchange.
//   request to 600h + node:   2F/2B/27/23 index subindex value   download of 1/2/3/4 bytes;   40 index subindex   upload
//   answer from 580h + node:  60 download done;   4F/4B/47/43 value   upload;   80 abort code
// Segmented: longer values, seven bytes in each further exchange; the toggle bit t (10h) alternates from 0.
//   download  21 index subindex size → 60        then  t | unused << 1 | last, data → 20 | t
//   upload    40 index subindex → 41 … size      then  60 | t → t | unused << 1 | last, data
// There is no block transfer.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/canopen/objects.hpp"

namespace trocar::hal::canopen {

enum class SdoAbort : std::uint32_t {
  ToggleBit = 0x0503'0000,
  Timeout = 0x0504'0000,
  UnknownCommand = 0x0504'0001,
  OutOfMemory = 0x0504'0005,
  WriteOnly = 0x0601'0001,
  ReadOnly = 0x0601'0002,
  NoObject = 0x0602'0000,
  NotMappable = 0x0604'0041,
  MappingTooLong = 0x0604'0042,
  WrongLength = 0x0607'0010,
  TooLong = 0x0607'0012,
  TooShort = 0x0607'0013,
  NoSubindex = 0x0609'0011,
  OutOfRange = 0x0609'0030,
  General = 0x0800'0000,
  DeviceState = 0x0800'0022,
  NoData = 0x0800'0024,
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

// Segments. `data`: at most seven bytes; `toggle`: 0 or 10h.
inline constexpr std::size_t sdo_segment_bytes = 7;
inline constexpr std::uint8_t sdo_toggle = 0x10;
[[nodiscard]] CanFrame sdo_segmented_download_request(std::uint8_t node, Object object, std::uint32_t bytes) noexcept;
[[nodiscard]] CanFrame sdo_segmented_upload_answer(std::uint8_t node, Object object, std::uint32_t bytes) noexcept;
[[nodiscard]] CanFrame sdo_segment(std::uint32_t cob, std::uint8_t toggle, std::span<const std::uint8_t> data, bool last) noexcept;
[[nodiscard]] CanFrame sdo_segment_command(std::uint32_t cob, std::uint8_t command) noexcept;  // no data: 20 | t or 60 | t
[[nodiscard]] constexpr std::size_t sdo_bytes_of_segment(const CanFrame& segment) noexcept {
  return sdo_segment_bytes - ((segment.data[0] >> 1) & 7u);
}

[[nodiscard]] SdoMessage decode_sdo_request(const CanFrame& frame) noexcept;
[[nodiscard]] SdoMessage decode_sdo_answer(const CanFrame& frame) noexcept;

// One transfer at a time with one node. A transfer takes one exchange, or several when it is segmented; the node decides for uploads.
class SdoClient {
 public:
  enum class State : std::uint8_t { Idle, Waiting, Done, Aborted, TimedOut };
  static constexpr std::size_t capacity = 64;  // bytes of the longest value

  explicit SdoClient(std::uint8_t node = 0) noexcept : node_{node} {}
  // Each starts a transfer and returns the request to send. An upload of an object with `bytes` 0 takes any length up to the capacity;
  // any other length than the object's own is aborted.
  [[nodiscard]] CanFrame upload(Object object, std::int64_t now_ns) noexcept;
  [[nodiscard]] CanFrame download(Object object, std::uint32_t value, std::int64_t now_ns) noexcept;
  // Precondition: data.size() <= capacity. Up to four bytes go expedited.
  [[nodiscard]] CanFrame download(Object object, std::span<const std::uint8_t> data, std::int64_t now_ns) noexcept;
  // An answer that belongs to no open transfer, or to another object, changes nothing and returns false.
  bool receive(const CanFrame& frame) noexcept;
  // True if there is something to send: the next request of a transfer, or the abort message of one that failed here.
  bool next_frame(CanFrame& frame, std::int64_t now_ns) noexcept;
  // At or beyond timeout_ns since its last request was sent, a waiting transfer ends as TimedOut.
  State update(std::int64_t now_ns, std::int64_t timeout_ns) noexcept;
  void reset() noexcept;  // an abort message that has not been sent yet stays

  [[nodiscard]] State state() const noexcept { return state_; }
  // Done: of the upload. value() are its first four bytes.
  [[nodiscard]] std::uint32_t value() const noexcept;
  [[nodiscard]] std::span<const std::uint8_t> data() const noexcept { return std::span{data_}.first(size_); }
  [[nodiscard]] std::uint32_t abort_code() const noexcept { return abort_code_; }  // Aborted

 private:
  void start(SdoKind kind, Object object, std::int64_t now_ns) noexcept;
  void initiated(const CanFrame& answer) noexcept;
  void segment_answered(const CanFrame& answer) noexcept;
  void put(const CanFrame& frame) noexcept;
  void put_download_segment() noexcept;
  void fail(SdoAbort code) noexcept;

  std::uint8_t node_;
  State state_{State::Idle};
  SdoKind asked_{SdoKind::None};
  Object object_{};
  std::int64_t started_ns_{};
  std::uint32_t abort_code_{};

  bool segmented_{};    // a download that takes several exchanges
  bool in_segments_{};  // past its first exchange
  std::uint8_t toggle_{};
  bool size_stated_{};
  std::uint32_t stated_size_{};  // of an upload
  std::size_t size_{};           // of data_: received so far, or to be sent
  std::size_t sent_{};           // of a download, including the segment on its way
  std::array<std::uint8_t, capacity> data_{};
  CanFrame outgoing_{};
  bool has_outgoing_{};
};

}  // namespace trocar::hal::canopen
