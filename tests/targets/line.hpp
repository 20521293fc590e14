// A line of a table without the C library's printf, which brings an allocator where it prints numbers with a point.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace trocar::targets {

class Line {
 public:
  Line& text(const char* words, std::size_t width = 0) noexcept {
    const std::size_t from = size_;
    while (*words != '\0') put(*words++);
    while (size_ - from < width) put(' ');
    return *this;
  }
  // To the right of its column.
  Line& number(std::uint64_t n, std::size_t width = 0) noexcept {
    std::array<char, 20> digits;
    std::size_t count = 0;
    do {
      digits[count++] = static_cast<char>('0' + n % 10);
      n /= 10;
    } while (n != 0);
    for (std::size_t k = count; k < width; ++k) put(' ');
    while (count > 0) put(digits[--count]);
    return *this;
  }
  // As 1.2e-13, rounded up beyond a thousandth, not negative.
  Line& scientific(double x) noexcept {
    if (x != x) return text("nan    ");
    if (x == 0.0) return text("0      ");
    if (x - x != 0.0) return text("inf    ");
    int exponent = 0;
    while (x >= 10.0) x /= 10.0, ++exponent;
    while (x < 1.0) x *= 10.0, --exponent;
    auto tenths = static_cast<std::uint64_t>(10.0 * x);
    if (10.0 * x - static_cast<double>(tenths) > 1e-2) ++tenths;
    if (tenths > 99) tenths /= 10, ++exponent;
    number(tenths / 10).text(".").number(tenths % 10).text("e").text(exponent < 0 ? "-" : "+");
    const auto size = static_cast<std::uint64_t>(exponent < 0 ? -exponent : exponent);
    return text(size < 10 ? "0" : "").number(size);
  }
  [[nodiscard]] const char* end() noexcept {
    text_[size_] = '\n';
    text_[size_ + 1] = '\0';
    size_ = 0;
    return text_.data();
  }

 private:
  void put(char c) noexcept {
    if (size_ + 2 < text_.size()) text_[size_++] = c;
  }
  std::array<char, 192> text_{};
  std::size_t size_{};
};

}  // namespace trocar::targets
