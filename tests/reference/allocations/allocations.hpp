// Counts what a program allocates. Linking it replaces operator new, so a test that uses it is a program of its own.
#pragma once

#include <cstddef>

namespace trocar::reference {

// Calls of operator new and, but under sanitizers, of malloc since the program began.
[[nodiscard]] std::size_t allocations() noexcept;

}  // namespace trocar::reference
