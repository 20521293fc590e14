#include "common/config/quote.hpp"

#include <fmt/format.h>

#include <cstddef>

namespace trocar::config {

std::string quote(std::string_view text) {
  std::string out = "\"";
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t k) { return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u; };
    const unsigned first = byte(0);
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xC2 && first < 0xE0 ? 2
                               : first >= 0xE0 && first < 0xF0 ? 3
                               : first >= 0xF0 && first < 0xF5 ? 4
                                                               : 0;
    bool good = length > 0;
    for (std::size_t k = 1; k < length; ++k) good = good && (byte(k) & 0xC0u) == 0x80u;
    // Overlong forms, surrogates, beyond U+10FFFF.
    if (first == 0xE0) good = good && byte(1) >= 0xA0;
    if (first == 0xED) good = good && byte(1) < 0xA0;
    if (first == 0xF0) good = good && byte(1) >= 0x90;
    if (first == 0xF4) good = good && byte(1) < 0x90;
    if (!good) {
      out += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    if (first == '"' || first == '\\')
      out += fmt::format("\\{}", static_cast<char>(first));
    else if (first < 0x20 || first == 0x7F)
      out += fmt::format("\\u{:04X}", first);
    else
      out += text.substr(i, length);
    i += length;
  }
  return out + "\"";
}

}  // namespace trocar::config
