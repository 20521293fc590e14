// The replay on the bare board: everything in one image, text and exit code through semihosting.
#include <cstring>

#include "tests/targets/line.hpp"
#include "tests/targets/mps2_an500/board.hpp"
#include "tests/targets/replay.hpp"

// The PC's vectors and image, as they are.
asm(".section .payload, \"a\"\n"
    ".balign 64\n"
    "golden_begin: .incbin \"" TROCAR_GOLDEN
    "\"\n"
    "golden_end:\n"
    ".balign 64\n"
    "image_begin: .incbin \"" TROCAR_IMAGE
    "\"\n"
    "image_end:\n"
    ".previous");
extern "C" const std::byte golden_begin[], golden_end[], image_begin[], image_end[];

namespace trocar::targets {
namespace {

Memory memory;

bool limited(const char* what, std::size_t used, std::size_t limit) {
  Line line;
  line.text(what, 48).number(used, 9).text(" bytes, limit ").number(limit, 9);
  board::print(line.text(used <= limit ? "  pass" : "  FAIL").end());
  return used <= limit;
}

bool memory_within_limits() {
  constexpr bool float64 = sizeof(Scalar) == 8;
  const board::MemoryUse use = board::memory_use();
  bool good = limited("ROM: code and constants", use.code + use.constants, 256U << 10U);
  good &= limited("ROM: with vectors and image", use.rom, use.rom_whole);
  good &= limited("RAM: static", use.initialised + use.zeroed, (float64 ? 2560U : 1408U) << 10U);
  good &= limited("RAM: static and reserved stack", use.ram, use.ram_whole);
  good &= limited("stack: most ever used", use.stack, use.stack_whole / 2);
  return good;
}

// The count against a loop of known length.
bool count_is_right() {
  constexpr std::uint32_t turns = 5'000'000;
  const std::uint64_t before = board::instructions();
  board::spend(turns);
  const std::uint64_t counted = board::instructions() - before;
  const bool good = counted >= 2 * turns - 80 && counted <= 2 * turns + 200;
  Line line;
  line.text("a loop of ").number(2 * turns).text(" instructions is counted as ").number(counted);
  board::print(line.text(good ? "  pass" : "  FAIL").end());
  return good;
}

}  // namespace
}  // namespace trocar::targets

int trocar::board::run() {
  targets::Wrong wrong = targets::Wrong::Nothing;
  if (std::strcmp(board::argument(), "wrong-value") == 0) wrong = targets::Wrong::Value;
  if (std::strcmp(board::argument(), "wrong-decision") == 0) wrong = targets::Wrong::Decision;
  const targets::Platform platform{.print = board::print, .now = board::instructions, .name = "Cortex-M7"};
  bool good = targets::count_is_right();
  good &= targets::replay({golden_begin, golden_end}, {image_begin, image_end}, targets::memory, platform, wrong);
  good &= targets::memory_within_limits();
  return good ? 0 : 1;
}
