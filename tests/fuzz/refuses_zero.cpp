// A target that is wrong on purpose: its property does not hold for inputs that begin with a zero. Shows that a finding ends a replay.
#include "property.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  trocar::fuzz::require(size == 0 || data[0] != '0', "no input begins with a zero");
  return 0;
}
