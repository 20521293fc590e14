// What a tick relies on in an opened image, section by section; image.hpp lists it. Linear in the image's size.
#pragma once

#include "common/model/image.hpp"

namespace trocar::model {

// The views lie in memory that may be read; their contents and sizes may be anything. Enumerations of `tissue` are in range.
[[nodiscard]] ImageStatus verify(const Image& image) noexcept;

}  // namespace trocar::model
