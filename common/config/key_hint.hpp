// What a person probably meant by a key or a value: units that end a key's name, and spelling.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "common/config/document.hpp"

namespace trocar::config {

// True when both keys name one quantity in two units: base_mm and base_m.
[[nodiscard]] bool differ_by_unit(std::string_view written, std::string_view wanted);

// "lengths are in metres: write base_m = 0.085 for 85 mm". `values`: what stands in the file, empty when it is no number.
[[nodiscard]] std::string unit_advice(std::string_view written, std::string_view wanted, std::span<const double> values);

// For a value outside of its range that would be inside in another unit: "if that is 85 mm, write 0.085"; else empty.
[[nodiscard]] std::string range_advice(std::string_view key, double value, Range range);

// The candidate that `written` most likely stands for, or empty. Units first, then spelling.
[[nodiscard]] std::string_view nearest(std::string_view written, std::span<const std::string_view> candidates);

}  // namespace trocar::config
