#include "tests/targets/mps2_an500/board.hpp"

#include <algorithm>
#include <array>
#include <cstring>

extern "C" {
extern std::byte text_begin[], text_end[], rodata_begin[], rodata_end[], payload_begin[], payload_end[], rom_end[];
extern std::byte data_begin[], data_end[], data_load[], bss_begin[], bss_end[], stack_limit[], stack_top[];
extern void (*init_begin[])();
extern void (*init_end[])();
}

namespace trocar::board {
namespace {

constexpr std::uint32_t paint = 0xC5C5'C5C5;
constexpr std::size_t whole = std::size_t{4} << 20U;  // ROM, and RAM (board.ld)
constexpr std::uintptr_t rom_origin = 0, ram_origin = 0x2000'0000;

// Semihosting calls (Arm, Semihosting for AArch32 and AArch64).
constexpr std::uint32_t sys_write0 = 0x04, sys_get_cmdline = 0x15, sys_exit_extended = 0x20;
constexpr std::uint32_t application_exit = 0x20026;

std::uint32_t semihost(std::uint32_t call, const void* block) noexcept {
  register std::uint32_t r0 asm("r0") = call;
  register const void* r1 asm("r1") = block;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

struct SysTick {
  std::uint32_t control, reload, value, calibration;
};
volatile SysTick& sys_tick = *reinterpret_cast<volatile SysTick*>(0xE000'E010);
constexpr std::uint32_t sys_tick_bits = 0xFF'FFFF;
constexpr std::uint64_t instructions_per_tick = 40;  // 1 ns each, a tick of 25 MHz

std::size_t between(const std::byte* begin, const std::byte* end) noexcept { return static_cast<std::size_t>(end - begin); }

[[noreturn]] void fault() {
  print("fault: the processor refused an access or an instruction\n");
  exit(3);
}

[[noreturn, gnu::noinline]] void start() {
  std::memcpy(data_begin, data_load, between(data_begin, data_end));
  std::memset(bss_begin, 0, between(bss_begin, bss_end));
  for (auto constructor = init_begin; constructor != init_end; ++constructor) (*constructor)();
  sys_tick.reload = sys_tick_bits;
  sys_tick.value = 0;
  sys_tick.control = 5;  // on, at the processor's clock, no interrupt
  exit(run());
}

}  // namespace

void print(const char* text) noexcept { semihost(sys_write0, text); }

const char* argument() noexcept {
  static std::array<char, 128> line;
  struct {
    char* text;
    std::uint32_t size;
  } block{line.data(), line.size()};
  if (semihost(sys_get_cmdline, &block) != 0) return "";
  const char* const space = std::strchr(line.data(), ' ');
  return space == nullptr ? "" : space + 1;
}

void exit(int code) noexcept {
  const std::array<std::uint32_t, 2> block{application_exit, static_cast<std::uint32_t>(code)};
  while (true) semihost(sys_exit_extended, block.data());
}

std::uint64_t instructions() noexcept {
  static std::uint32_t last = sys_tick_bits;
  static std::uint64_t ticks = 0;
  const std::uint32_t value = sys_tick.value;
  ticks += (last - value) & sys_tick_bits;
  last = value;
  return instructions_per_tick * ticks;
}

void spend(std::uint32_t n) noexcept {
  asm volatile(
      "1: subs %0, %0, #1\n"
      "   bne 1b\n"
      : "+r"(n)
      :
      : "cc");
}

MemoryUse memory_use() noexcept {
  MemoryUse use{};
  use.code = between(text_begin, text_end);
  use.constants = between(rodata_begin, rodata_end);
  use.payload = between(payload_begin, payload_end);
  use.rom = reinterpret_cast<std::uintptr_t>(rom_end) - rom_origin;
  use.initialised = between(data_begin, data_end);
  use.zeroed = between(bss_begin, bss_end);
  const auto* word = reinterpret_cast<const volatile std::uint32_t*>(stack_limit);
  std::size_t untouched = 0;
  use.stack_whole = between(stack_limit, stack_top);
  while (untouched < use.stack_whole && *word++ == paint) untouched += sizeof paint;
  use.stack = use.stack_whole - untouched;
  use.ram = reinterpret_cast<std::uintptr_t>(bss_end) - ram_origin;
  use.rom_whole = use.ram_whole = whole;
  return use;
}

// FPU on, stack painted, then C++. In assembler, because nothing may stand on the stack while it is painted.
extern "C" [[gnu::naked, noreturn]] void reset() {
  asm volatile(
      "  ldr r0, =0xE000ED88\n"  // CPACR: full access to the FPU
      "  ldr r1, [r0]\n"
      "  orr r1, r1, #0xF00000\n"
      "  str r1, [r0]\n"
      "  dsb\n"
      "  isb\n"
      "  ldr r0, =stack_limit\n"
      "  ldr r1, =stack_top\n"
      "  mov sp, r1\n"
      "  ldr r2, =%c0\n"
      "1: str r2, [r0], #4\n"
      "  cmp r0, r1\n"
      "  blo 1b\n"
      "  b %c1\n"
      :
      : "i"(paint), "i"(start));
}

using Handler = void (*)();
struct Vectors {
  std::byte* stack;
  std::array<Handler, 15> handler;
};
extern "C" [[gnu::section(".vectors"), gnu::used]] const Vectors vectors{
    stack_top, {reset, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault}};

}  // namespace trocar::board
