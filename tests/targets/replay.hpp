// Replays golden vectors and compares: this build's answers against the PC's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "tests/targets/cases.hpp"

namespace trocar::targets {

// What is made wrong in every case, to see that it is noticed: a value of the first vector by twice its bound, or one decision more than
// may differ.
enum class Wrong : std::uint8_t { Nothing, Value, Decision };

struct Platform {
  void (*print)(const char* text);
  Now now;  // counts instructions, or gives 0
  const char* name;
};

// Of an image as compiled for this kind of build (image_float64.cpp, image_float32.cpp).
[[nodiscard]] bool open_image(std::span<const std::byte> bytes, Memory& memory, model::Image& image) noexcept;

// Prints a table of the cases; true when every one of them is within its bound.
[[nodiscard]] bool replay(std::span<const std::byte> golden, std::span<const std::byte> image, Memory& memory, const Platform& platform,
                          Wrong wrong) noexcept;

}  // namespace trocar::targets
