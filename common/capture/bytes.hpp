// Little-endian building and reading of MCAP records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "common/capture/mcap_format.hpp"

namespace trocar::capture {

class RecordBuilder {
 public:
  explicit RecordBuilder(std::vector<std::byte>& out) : out_(out) {}

  RecordBuilder& begin(Opcode opcode) {
    number(static_cast<std::uint8_t>(opcode));
    length_at_ = out_.size();
    return number(std::uint64_t{0});
  }
  void end() { patch(length_at_, std::uint64_t{out_.size() - length_at_ - 8}); }

  template <class U>
  RecordBuilder& number(U value) {
    static_assert(std::is_unsigned_v<U>);
    for (std::size_t i = 0; i < sizeof(U); ++i) out_.push_back(static_cast<std::byte>((std::uint64_t{value} >> (8 * i)) & 0xFFu));
    return *this;
  }
  RecordBuilder& text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    return raw(std::as_bytes(std::span(value)));
  }
  RecordBuilder& raw(std::span<const std::byte> value) {
    out_.insert(out_.end(), value.begin(), value.end());
    return *this;
  }
  template <class U>
  void patch(std::size_t at, U value) {
    for (std::size_t i = 0; i < sizeof(U); ++i) out_[at + i] = static_cast<std::byte>((std::uint64_t{value} >> (8 * i)) & 0xFFu);
  }

 private:
  std::vector<std::byte>& out_;
  std::size_t length_at_{};
};

// Reads past the end yield zeros and clear ok(): callers check once, at the end of a record.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class U>
  U number() {
    static_assert(std::is_unsigned_v<U>);
    const auto part = raw(sizeof(U));
    U value{};
    for (std::size_t i = 0; i < part.size(); ++i) value = static_cast<U>(value | static_cast<U>(std::to_integer<U>(part[i]) << (8 * i)));
    return value;
  }
  std::string text() {
    const auto part = raw(number<std::uint32_t>());
    return {reinterpret_cast<const char*>(part.data()), part.size()};
  }
  std::span<const std::byte> raw(std::uint64_t size) {
    if (size > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const auto part = bytes_.first(static_cast<std::size_t>(size));
    bytes_ = bytes_.subspan(static_cast<std::size_t>(size));
    return part;
  }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size(); }
  [[nodiscard]] bool ok() const noexcept { return ok_; }

 private:
  std::span<const std::byte> bytes_;
  bool ok_ = true;
};

// A text from a file, for a message: a terminal shall not act on what a damaged one holds.
[[nodiscard]] inline std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return text;
}

}  // namespace trocar::capture
