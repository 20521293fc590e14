// The replay on a processor with an operating system.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <cstdio>
#include <cstring>

#include "tests/targets/replay.hpp"

namespace {

std::span<const std::byte> mapped(const char* file) {
  const int descriptor = ::open(file, O_RDONLY | O_CLOEXEC);
  struct stat about {};
  if (descriptor < 0 || ::fstat(descriptor, &about) != 0) return {};
  const auto size = static_cast<std::size_t>(about.st_size);
  const void* const bytes = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (bytes == MAP_FAILED) return {};
  return {static_cast<const std::byte*>(bytes), size};
}

trocar::targets::Memory memory;

}  // namespace

int main(int count, char** argument) {
  using trocar::targets::Wrong;
  if (count < 3 || count > 4) {
    std::fprintf(stderr, "usage: %s VECTORS IMAGE [wrong-value | wrong-decision]\n", argument[0]);
    return 2;
  }
  Wrong wrong = Wrong::Nothing;
  if (count == 4) wrong = std::strcmp(argument[3], "wrong-value") == 0 ? Wrong::Value : Wrong::Decision;
  const trocar::targets::Platform platform{
      .print = [](const char* text) { std::fputs(text, stdout); }, .now = []() -> std::uint64_t { return 0; }, .name = TROCAR_TARGET};
  return trocar::targets::replay(mapped(argument[1]), mapped(argument[2]), memory, platform, wrong) ? 0 : 1;
}
