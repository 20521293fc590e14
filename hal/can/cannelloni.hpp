// CAN frames in UDP datagrams: the open cannelloni format, version 2, data datagrams.
//   header, 5 bytes: version = 2 | operation = 0 (data) | sequence number | count of frames (2 bytes, big-endian)
//   each frame:      identifier (4 bytes, big-endian, flags as in linux/can.h: bit 31 extended, 30 remote, 29 error)
//                    | length (bit 7: CAN FD, then one flags byte follows) | data; a remote frame has a length but no data
// Source: doc/udp_format.md of github.com/mguentner/cannelloni.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/can/frame.hpp"

namespace trocar::hal::cannelloni {

inline constexpr std::size_t header_bytes = 5;
inline constexpr std::size_t max_frame_bytes = 4 + 1 + 8;
inline constexpr std::size_t max_datagram_bytes = 1472;  // one Ethernet frame
inline constexpr std::size_t receive_bytes = 65536;      // any UDP datagram: a gateway may use jumbo frames

// Gathers frames into one datagram.
class Writer {
 public:
  [[nodiscard]] bool append(const CanFrame& frame) noexcept;  // false: full, or not a frame; nothing is changed then
  [[nodiscard]] std::uint16_t count() const noexcept { return count_; }
  // The finished datagram; valid until the next append().
  [[nodiscard]] std::span<const std::uint8_t> finish(std::uint8_t sequence) noexcept;
  void clear() noexcept {
    count_ = 0;
    size_ = header_bytes;
  }

 private:
  std::array<std::uint8_t, max_datagram_bytes> bytes_{};
  std::size_t size_{header_bytes};
  std::uint16_t count_{};
};

// Walks through one datagram. A datagram is taken as a whole or not at all: frames before a damaged place are not trusted either.
class Reader {
 public:
  // False when malformed: foreign version or operation, cut off, bytes left over, or a length that no frame has.
  // The bytes must outlive the reader's next().
  [[nodiscard]] bool open(std::span<const std::uint8_t> datagram) noexcept;
  [[nodiscard]] std::uint8_t sequence() const noexcept { return sequence_; }
  [[nodiscard]] std::uint32_t unsupported() const noexcept { return unsupported_; }  // CAN FD frames, which next() leaves out
  [[nodiscard]] bool next(CanFrame& frame) noexcept;

 private:
  enum class Kind : std::uint8_t { Frame, Unsupported, Malformed };
  [[nodiscard]] Kind take(CanFrame& frame) noexcept;

  std::span<const std::uint8_t> rest_{};
  std::uint32_t left_{};
  std::uint32_t unsupported_{};
  std::uint8_t sequence_{};
};

}  // namespace trocar::hal::cannelloni
