#include "firmware/targets/linux/allocations.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <thread>

namespace trocar {
namespace {

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

template <class Function>
std::uint64_t counted(Function&& function) {
  const std::uint64_t before = allocations_of_this_thread();
  function();
  return allocations_of_this_thread() - before;
}

// So that the compiler does not take allocations away whose memory nobody looks at.
void* kept(void* memory) {
  asm volatile("" : "+r"(memory));
  return memory;
}

TEST(Allocations, AreCountedWhateverTheirWay) {
  EXPECT_EQ(counted([] {}), 0u);
  EXPECT_EQ(counted([] { free(kept(malloc(10))); }), 1u);
  EXPECT_EQ(counted([] { free(kept(calloc(10, 10))); }), 1u);
  EXPECT_EQ(counted([] { free(kept(aligned_alloc(64, 128))); }), 1u);
  EXPECT_EQ(counted([] {
              void* memory = nullptr;
              ASSERT_EQ(posix_memalign(&memory, 64, 100), 0);
              free(kept(memory));
            }),
            1u);
  EXPECT_EQ(counted([] {
              void* memory = kept(malloc(10));
              free(kept(realloc(memory, 1000)));
            }),
            2u);
  EXPECT_EQ(counted([] {
              auto* value = new int(3);
              kept(value);
              delete value;
            }),
            1u);
  struct alignas(128) Wide {
    char bytes[128];
  };
  EXPECT_EQ(counted([] {
              auto* value = new Wide;
              kept(value);
              delete value;
            }),
            1u);
}

TEST(Allocations, OfAnotherThreadAreItsOwn) {
  std::thread other;
  std::uint64_t theirs = 0;
  std::atomic<bool> go{false}, done{false};
  other = std::thread{[&] {
    while (!go) std::this_thread::yield();
    theirs = counted([] {
      for (int i = 0; i < 100; ++i) free(kept(malloc(10)));
    });
    done = true;
  }};
  EXPECT_EQ(counted([&] {
              go = true;
              while (!done) std::this_thread::yield();
            }),
            0u);
  other.join();
  EXPECT_EQ(theirs, 100u);
}

TEST(Allocations, AreAsGoodAsTheCLibrarys) {
  void* memory = nullptr;
  EXPECT_EQ(posix_memalign(&memory, 3, 100), EINVAL);
  EXPECT_EQ(memory, nullptr);
  memory = aligned_alloc(256, 512);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory) % 256, 0u);
  free(memory);
}

#endif

}  // namespace
}  // namespace trocar
