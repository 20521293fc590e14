// An input as a file, for readers that take a path: in memory, one for the whole process.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "property.hpp"

namespace trocar::fuzz {

// The path is valid until the next call.
inline std::filesystem::path memory_file(const std::uint8_t* data, std::size_t size) {
  static const int file = memfd_create("input", 0);
  require(file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == static_cast<ssize_t>(size), "the input fits in memory");
  return "/proc/self/fd/" + std::to_string(file);
}

// What is said to a person.
inline void require_line(const std::string& message) {
  require(!message.empty(), "a refusal says why");
  for (const char c : message) require(c != '\n' && c != '\r' && c != '\0' && c != '\x1b', "a refusal is one line without control codes");
}

// What a reader says of a file that it refuses: one line for a person, that begins with the file.
inline void require_message(const std::string& message, const std::filesystem::path& file) {
  require(message.starts_with(file.string() + ":") || message.starts_with(file.string() + ","), "a refusal begins with the file");
  require(message.size() > file.string().size() + 4, "a refusal says why");
  require_line(message);
}

}  // namespace trocar::fuzz
