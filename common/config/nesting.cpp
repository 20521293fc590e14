#include "common/config/nesting.hpp"

namespace trocar::config {
namespace {

// Position after the string that opens at `i`; counts the newlines that it crosses. An unterminated string ends the text:
// the parser reports it, and stops before anything that this scan may have misread.
std::size_t skip_string(std::string_view toml, std::size_t i, std::size_t& line) noexcept {
  const char quote = toml[i];
  const bool multiline = toml.substr(i, 3) == std::string_view(quote == '"' ? "\"\"\"" : "'''");
  i += multiline ? 3 : 1;
  for (; i < toml.size(); ++i) {
    if (toml[i] == '\n') {
      if (!multiline) return i;
      ++line;
    } else if (toml[i] == '\\' && quote == '"') {
      if (i + 1 < toml.size() && toml[i + 1] != '\n') ++i;
    } else if (toml[i] == quote) {
      if (!multiline) return i + 1;
      if (toml.size() - i < 3 || toml[i + 1] != quote || toml[i + 2] != quote) continue;
      i += 3;  // up to two further quotes may belong to the text
      while (i < toml.size() && toml[i] == quote) ++i;
      return i;
    }
  }
  return i;
}

}  // namespace

std::size_t line_nested_too_deep(std::string_view toml) noexcept {
  std::size_t line = 1;
  std::size_t brackets = 0;
  std::size_t dots = 0;  // since the last separator: the parts of one key
  for (std::size_t i = 0; i < toml.size();) {
    const char c = toml[i];
    if (c == '"' || c == '\'') {
      i = skip_string(toml, i, line);
      continue;
    }
    if (c == '#') {
      while (i < toml.size() && toml[i] != '\n') ++i;
      continue;
    }
    if (c == '.') {
      ++dots;
    } else if (c == '[' || c == '{') {
      ++brackets;
      dots = 0;
    } else if (c == ']' || c == '}') {
      brackets -= brackets > 0 ? 1u : 0u;
      dots = 0;
    } else if (c == '=' || c == ',' || c == '\n') {
      dots = 0;
    }
    if (brackets > nesting_limit || dots > nesting_limit) return line;
    if (c == '\n') ++line;
    ++i;
  }
  return 0;
}

}  // namespace trocar::config
