// The one message for a person when input cannot be used. For files: "FILE:LINE: key = value: what is wrong; what to do".
// Programs print what() alone and end with exit code 1.
#pragma once

#include <stdexcept>
#include <string>

namespace trocar::config {

class UserError : public std::runtime_error {
 public:
  explicit UserError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace trocar::config
