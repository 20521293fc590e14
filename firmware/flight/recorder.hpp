// Flight recorder: keeps the last samples, and when a fault is latched makes a recording of them with what follows for a short while.
// A fault that comes while another one's aftermath is recorded is in that recording: its first cause counts.
// Allocates at construction and for each recording; for the thread behind the controller's rings.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/core/capacities.hpp"
#include "common/core/contracts.hpp"

namespace trocar::flight {

struct Recording {
  Fault fault{};               // the first cause
  std::uint64_t fault_tick{};  // of the first sample that has it
  // In order. Up to capacity::flight_recorder until and with the fault's, then up to capacity::flight_aftermath; fewer when the
  // controller had not run for so long, or ended. Samples that the controller's ring dropped are missing.
  std::vector<Sample> samples;
};

class Recorder {
 public:
  Recorder() { kept_.resize(capacity::flight_recorder); }

  // True when a recording has become whole with this sample; take() it before the next one. The sample itself says when a fault was
  // latched, so that there is no order to keep between samples and events.
  bool push(const Sample& sample) {
    const bool latched = sample.fault != Fault::None && sample.fault != last_fault_;
    last_fault_ = sample.fault;
    kept_[pushed_ % kept_.size()] = sample;
    ++pushed_;
    if (aftermath_left_ > 0) {
      recording_.samples.push_back(sample);
      return --aftermath_left_ == 0;
    }
    if (!latched) return false;
    recording_ = {sample.fault, sample.tick, {}};
    recording_.samples.reserve(capacity::flight_recorder + capacity::flight_aftermath);
    for (std::uint64_t i = pushed_ - std::min<std::uint64_t>(pushed_, kept_.size()); i < pushed_; ++i)
      recording_.samples.push_back(kept_[i % kept_.size()]);
    aftermath_left_ = capacity::flight_aftermath;
    return false;
  }

  // No sample will follow: true when a recording had begun, which is then as whole as it can be.
  bool finish() { return std::exchange(aftermath_left_, 0) > 0; }

  [[nodiscard]] Recording take() { return std::exchange(recording_, {}); }

 private:
  std::vector<Sample> kept_;  // a ring
  std::uint64_t pushed_{};
  Fault last_fault_{Fault::None};
  std::size_t aftermath_left_{};
  Recording recording_;
};

}  // namespace trocar::flight
