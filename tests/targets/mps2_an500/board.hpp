// What a program on the bare board has instead of an operating system: start-up, text and exit code through the debugger's semihosting
// (which the emulator answers), a count of instructions, and figures about its own memory.
#pragma once

#include <cstddef>
#include <cstdint>

namespace trocar::board {

// The program, once memory and FPU are ready; gives the exit code.
int run();

void print(const char* text) noexcept;
// The word behind the program's name on the command line; empty without.
[[nodiscard]] const char* argument() noexcept;
[[noreturn]] void exit(int code) noexcept;

// Instructions since some moment, in steps of 40. By SysTick at 25 MHz: right where the emulator lets every instruction take a nanosecond
// (qemu -icount shift=0); on silicon it would be time. Calls have to follow each other within 0.6 s.
[[nodiscard]] std::uint64_t instructions() noexcept;
// Executes exactly 2 n instructions and a few around them: what the count is checked with.
void spend(std::uint32_t n) noexcept;

struct MemoryUse {
  std::size_t code, constants;      // in ROM
  std::size_t payload;              // in ROM, brought along by a test
  std::size_t rom, rom_whole;       // all that is taken, all that there is
  std::size_t initialised, zeroed;  // static, in RAM
  std::size_t stack, stack_whole;   // most that was ever used, reserved
  std::size_t ram, ram_whole;       // static and the reserved stack; all that there is
};
[[nodiscard]] MemoryUse memory_use() noexcept;

}  // namespace trocar::board
