// Texts that came from outside (names of files), written so that a reader takes them.
#pragma once

#include <string>
#include <string_view>

namespace trocar::config {

// The text in quotes, as TOML and JSON both read it. Names of files are bytes: what is not UTF-8 becomes the replacement character.
[[nodiscard]] std::string quote(std::string_view text);

}  // namespace trocar::config
