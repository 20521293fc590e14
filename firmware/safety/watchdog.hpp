// Counts time since something was last seen, and says when that is longer than allowed. Exactly the limit is still in time.
#pragma once

#include <cstdint>

namespace trocar::safety {

class Watchdog {
 public:
  explicit constexpr Watchdog(std::int64_t limit_ns) noexcept : limit_ns_(limit_ns) {}
  constexpr void feed(std::int64_t now_ns) noexcept { last_ns_ = now_ns; }
  [[nodiscard]] constexpr bool expired(std::int64_t now_ns) const noexcept { return now_ns - last_ns_ > limit_ns_; }
  [[nodiscard]] constexpr std::int64_t age_ns(std::int64_t now_ns) const noexcept { return now_ns - last_ns_; }

 private:
  std::int64_t limit_ns_;
  std::int64_t last_ns_{};
};

}  // namespace trocar::safety
