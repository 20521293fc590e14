// A program of the system, run to its end.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trocar::tool {

struct Outcome {
  int error_number{};      // errno: it could not be started; ENOENT: it is not installed
  bool good{};             // exit code 0
  std::string messages{};  // what it wrote to stderr
};

// command[0] is looked for in PATH. Its stdout is dropped; `messages` is a file in a place that may be written to, left behind.
[[nodiscard]] Outcome run(std::vector<std::string> command, const std::filesystem::path& messages);

}  // namespace trocar::tool
