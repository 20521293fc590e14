#include "sim_plant/faults/faults.hpp"

#include <cmath>

namespace trocar::sim_plant {

namespace {

bool active(const Trouble& t, std::int64_t now_ns) noexcept { return now_ns >= t.from_ns && now_ns < t.to_ns; }

}  // namespace

std::vector<hal::CanFrame> Faults::passed(Wire wire, Way way, const hal::CanFrame& frame, std::int64_t now_ns) {
  std::vector<hal::CanFrame> out{frame};
  for (Active& a : troubles_) {
    const Trouble& t = a.trouble;
    if (t.wire != wire || t.way != way || t.ailment > Ailment::Flipped || (frame.id & t.mask) != (t.id & t.mask)) continue;
    if (!active(t, now_ns)) {
      if (a.holds) out.insert(out.begin(), a.held);
      a.holds = false;
      continue;
    }
    std::vector<hal::CanFrame> next;
    for (hal::CanFrame f : out) switch (t.ailment) {
        case Ailment::Lost:
          break;
        case Ailment::Late:
          under_way_.push_back({wire, f, now_ns + std::llround(1e9 * t.amount)});
          break;
        case Ailment::Twice:
          next.insert(next.end(), 2, f);
          break;
        case Ailment::OutOfOrder:
          if (a.holds) {
            next.push_back(f);
            next.push_back(a.held);
          } else {
            a.held = f;
          }
          a.holds = !a.holds;
          break;
        case Ailment::Shortened:
          if (f.length > 0) --f.length;
          next.push_back(f);
          break;
        case Ailment::Flipped: {
          const auto bit = static_cast<std::size_t>(t.amount);
          if (bit / 8 < f.length) f.data[bit / 8] = static_cast<std::uint8_t>(f.data[bit / 8] ^ (1U << (bit % 8)));
          next.push_back(f);
          break;
        }
        default:
          next.push_back(f);
      }
    out = std::move(next);
  }
  return out;
}

std::vector<hal::CanFrame> Faults::due(Wire wire, std::int64_t now_ns) {
  std::vector<hal::CanFrame> out;
  std::erase_if(under_way_, [&](const UnderWay& u) {
    const bool is = u.wire == wire && u.due_ns <= now_ns;
    if (is) out.push_back(u.frame);
    return is;
  });
  for (const Active& a : troubles_) {
    const Trouble& t = a.trouble;
    if (t.ailment != Ailment::Babbled || t.wire != wire || !active(t, now_ns)) continue;
    const std::int64_t every_ns = std::llround(1e6 / t.amount);
    for (babbled_to_ns_ = std::max(babbled_to_ns_, t.from_ns); babbled_to_ns_ <= now_ns; babbled_to_ns_ += every_ns)
      out.push_back({.id = 0x001, .length = 8});
  }
  return out;
}

const Trouble* Faults::on(Ailment ailment, std::size_t drive, std::int64_t now_ns) const noexcept {
  for (const Active& a : troubles_)
    if (a.trouble.ailment == ailment && a.trouble.drive == drive && active(a.trouble, now_ns)) return &a.trouble;
  return nullptr;
}

const Trouble* Faults::once(Ailment ailment, std::size_t drive, std::int64_t now_ns) noexcept {
  for (Active& a : troubles_)
    if (!a.done && a.trouble.ailment == ailment && a.trouble.drive == drive && active(a.trouble, now_ns)) {
      a.done = true;
      return &a.trouble;
    }
  return nullptr;
}

}  // namespace trocar::sim_plant
