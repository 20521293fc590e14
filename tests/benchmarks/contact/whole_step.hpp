// The whole step of common/insertion, as the tick calls it: a scene compiled on the sheet of partner/sheet.hpp with a mesh of any size, the
// needle inserted until it has a given number of contacts.
#pragma once

#include <cstddef>
#include <memory>

#include "common/image_file/bytes.hpp"
#include "common/insertion/insertion.hpp"

namespace trocar::bench {

class WholeStep {
 public:
  enum class Motion {
    Turn,      // about the entry, every tick
    ToAndFro,  // along the shaft by 1 mm
    Rest,
    Outside  // in the air before the tissue
  };
  // Throws when the scene cannot be compiled or the contacts are not reached within the tissue.
  WholeStep(int nodes_per_side, std::size_t contacts, Motion motion, bool reuse_factor = true);
  double tick();                          // seconds of the step
  [[nodiscard]] double slipping() const;  // share of the contacts
  [[nodiscard]] std::size_t contacts() const { return insertion_->contacts(); }

 private:
  void settle(const insertion::Pose& pose);

  image_file::AlignedBytes bytes_{};
  model::Image image_{};
  std::unique_ptr<insertion::Insertion> insertion_{std::make_unique<insertion::Insertion>()};
  Motion motion_;
  double depth_m_{};
  long tick_{};
};

}  // namespace trocar::bench
