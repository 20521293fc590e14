// Says when a loop has stopped passing. Somebody else than the loop looks every now and then. A look that comes late itself counts as one
// look only: when the whole process or machine stood still (stopped, suspended, starved), the loop had no chance to pass either.
#pragma once

#include <algorithm>
#include <cstdint>

namespace trocar::safety {

class Stall {
 public:
  // limit_ns: longest time without a pass, exactly the limit is still in time; look_ns: time between looks.
  constexpr Stall(std::int64_t limit_ns, std::int64_t look_ns) noexcept : limit_ns_(limit_ns), look_ns_(look_ns) {}

  // passes: how often the loop has passed; 0 while it has not begun, which is no stall.
  [[nodiscard]] constexpr bool look(std::uint64_t passes, std::int64_t now_ns) noexcept {
    silent_ns_ = passes == 0 || passes != passes_ ? 0 : silent_ns_ + std::clamp<std::int64_t>(now_ns - looked_ns_, 0, look_ns_);
    passes_ = passes;
    looked_ns_ = now_ns;
    return silent_ns_ > limit_ns_;
  }

 private:
  std::int64_t limit_ns_, look_ns_;
  std::int64_t silent_ns_{};
  std::int64_t looked_ns_{};
  std::uint64_t passes_{};
};

}  // namespace trocar::safety
