// An image that does what none may, for the test of the symbol table.
#include <cstdlib>

#include "tests/targets/mps2_an500/board.hpp"

extern "C" void* _sbrk(std::ptrdiff_t) { return nullptr; }  // without it, malloc does not link

int trocar::board::run() {
  void* volatile memory = std::malloc(1);
  return memory == nullptr ? 1 : 0;
}
