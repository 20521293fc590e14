// Counts what the calling thread allocates: malloc and its kin are taken over for the whole program and passed on to the C library, a
// thread-local count the richer. Under sanitizers, which need that place for themselves, nothing is counted.
#pragma once

#include <cstdint>

namespace trocar {

[[nodiscard]] std::uint64_t allocations_of_this_thread() noexcept;

}  // namespace trocar
