#include "hal/can/candump.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdio>

namespace trocar::hal {

CandumpLine candump_line(const CanFrame& frame, std::int64_t time_ns, const char* interface) noexcept {
  constexpr std::uint32_t error_flag = 0x2000'0000u;
  CandumpLine line{};
  const std::uint32_t id = frame.error ? frame.id | error_flag : frame.id;
  const int digits = frame.extended || frame.error ? 8 : 3;
  auto size = static_cast<std::size_t>(
      std::snprintf(line.data(), line.size(), "(%010lld.%06lld) %.15s %0*X#", static_cast<long long>(time_ns / 1'000'000'000),
                    static_cast<long long>(time_ns / 1000 % 1'000'000), interface, digits, static_cast<unsigned>(id)));
  const auto put = [&](char c) {
    if (size + 2 < line.size()) line[size++] = c;
  };
  constexpr const char* hex = "0123456789ABCDEF";
  if (frame.remote) {
    put('R');
    if (frame.length > 0) put(hex[frame.length & 0xF]);
  } else {
    for (std::size_t i = 0; i < std::min<std::size_t>(frame.length, frame.data.size()); ++i) {
      put(hex[frame.data[i] >> 4]);
      put(hex[frame.data[i] & 0xF]);
    }
  }
  line[size] = '\n';
  return line;
}

}  // namespace trocar::hal
