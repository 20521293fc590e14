#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include "firmware/targets/linux/loop.hpp"

namespace trocar {
namespace {

constexpr std::size_t pages = 64;

// As many page faults and more, in this thread.
void fault() {
  const auto size = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  void* memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  ::madvise(memory, size, MADV_NOHUGEPAGE);
  for (std::size_t i = 0; i < pages; ++i) static_cast<volatile char*>(memory)[i * size / pages] = 1;
  ::munmap(memory, size);
}

TEST(Tally, CountsFromItsBeginningAndKeepsApartWhatCameWhileArmed) {
  fault();
  Tally tally;
  fault();
  tally.take(false);
  const LoopCounters unarmed = tally.counters();
  EXPECT_GE(unarmed.minor_faults + unarmed.major_faults, pages);
  EXPECT_LT(unarmed.minor_faults + unarmed.major_faults, 2 * pages);
  EXPECT_EQ(unarmed.armed_page_faults, 0u);
  EXPECT_EQ(unarmed.armed_allocations, 0u);

  tally.take(true);
  const std::uint64_t on_the_way = tally.counters().armed_page_faults;
  fault();
  tally.take(true);
  EXPECT_GE(tally.counters().armed_page_faults - on_the_way, pages);
  tally.take(false);
  const std::uint64_t armed = tally.counters().armed_page_faults;
  fault();
  tally.take(false);
  EXPECT_EQ(tally.counters().armed_page_faults, armed);
}

// The tick that takes the torque off, or puts it on, ran with it in part.
TEST(Tally, TakesATickWithTorqueAtEitherEndForArmed) {
  Tally tally;
  tally.take(false);
  fault();
  tally.take(true);
  EXPECT_GE(tally.counters().armed_page_faults, pages);
  fault();
  tally.take(false);
  EXPECT_GE(tally.counters().armed_page_faults, 2 * pages);
}

TEST(Tally, CountsOverruns) {
  Tally tally;
  tally.overrun();
  tally.overrun();
  EXPECT_EQ(tally.counters().overruns, 2u);
}

}  // namespace
}  // namespace trocar
