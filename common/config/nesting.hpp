// Guard before the TOML parser: how deep a text nests, found by its characters alone.
#pragma once

#include <cstddef>
#include <string_view>

namespace trocar::config {

inline constexpr std::size_t nesting_limit = 16;

// The line (from 1) at which brackets, braces or the parts of a dotted key first nest deeper than nesting_limit; 0 when nowhere.
// The parser and its tree are recursive: without this a small file could exhaust the stack.
[[nodiscard]] std::size_t line_nested_too_deep(std::string_view toml) noexcept;

}  // namespace trocar::config
