// Golden vectors: what the PC's build computed, as a stream of bytes that other builds replay.
// Every number takes 8 bytes, little endian: a floating-point number as float64, anything else as int64. So one stream serves builds
// whose numbers have other sizes; what they have to agree on is the order in which fields.hpp names them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace trocar::targets {

static_assert(std::endian::native == std::endian::little);

// Reads into whatever it is called with.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {}

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(T& value) noexcept {
    if constexpr (std::is_floating_point_v<T>)
      value = static_cast<T>(take<double>());
    else
      value = static_cast<T>(take<std::int64_t>());
  }
  template <class T, std::size_t n>
  void operator()(std::array<T, n>& values) noexcept {
    for (T& value : values) (*this)(value);
  }
  // That many elements as they stand in the stream, on the next multiple of 8.
  template <class T>
  void view(std::span<const T>& elements) noexcept {
    const auto count = static_cast<std::size_t>(take<std::int64_t>());
    const std::size_t size = (count * sizeof(T) + 7) / 8 * 8;
    ok_ = ok_ && size <= bytes_.size() - at_;
    if (!ok_) return;
    elements = {reinterpret_cast<const T*>(bytes_.data() + at_), count};
    at_ += size;
  }

  [[nodiscard]] bool ok() const noexcept { return ok_; }  // nothing was missing so far
  [[nodiscard]] bool at_end() const noexcept { return at_ == bytes_.size(); }
  [[nodiscard]] std::size_t at() const noexcept { return at_; }

 private:
  template <class T>
  T take() noexcept {
    T value{};
    ok_ = ok_ && sizeof(T) <= bytes_.size() - at_;
    if (!ok_) return value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }

  std::span<const std::byte> bytes_;
  std::size_t at_{0};
  bool ok_{true};
};

}  // namespace trocar::targets
