// The virtual needle of a haptic display: a pose of its base in, the wrench of its base on the needle out, in the same tick. The model is
// an image (common/model); another one may be offered at any time, by one other thread, and is taken at a tick boundary without a step of
// the wrench: what the old one pushed fades away.
#pragma once

#include <atomic>
#include <memory>

#include "common/insertion/insertion.hpp"
#include "common/mechanism/types.hpp"
#include "firmware/control/fade.hpp"

namespace trocar::virtual_needle {

class VirtualNeedle {
 public:
  explicit VirtualNeedle(const control::FadeConfig& fade = {});  // allocates its model; nothing else does
  // Where there is no allocator: in the caller's memory, which must outlive this.
  explicit VirtualNeedle(insertion::Insertion& model, const control::FadeConfig& fade = {}) noexcept;

  // Any thread, one at a time. The image must outlive its use: until the next offer has been taken (`using_image`).
  void offer(const model::Image* image) noexcept { offered_.store(image, std::memory_order_release); }
  [[nodiscard]] const model::Image* using_image() const noexcept { return used_.load(std::memory_order_acquire); }

  // The tick's own, from here on.
  // Takes what was offered; true when there is a model.
  bool ready() noexcept;
  // Outside of the tissue or wherever it is: contacts and path of before are forgotten.
  void start() noexcept;
  // dt_s > 0. N, N, N m about the base.
  mechanism::Vec3 step(const mechanism::Vec3& base_pose, double dt_s) noexcept;

  [[nodiscard]] const insertion::Result& result() const noexcept { return result_; }
  // Ticks in a row without a solution; the wrench is then the last one's, carried on.
  [[nodiscard]] std::uint32_t unsolved_ticks() const noexcept { return unsolved_; }

 private:
  void take() noexcept;

  std::atomic<const model::Image*> offered_{nullptr}, used_{nullptr};
  std::unique_ptr<insertion::Insertion> own_model_{};
  insertion::Insertion* model_;
  insertion::Result result_{};
  control::FadeConfig fade_config_{};
  control::FadeState fade_{};
  mechanism::Vec3 wrench_ = mechanism::Vec3::Zero();
  bool swapped_{false};
  std::uint32_t unsolved_{0};
};

}  // namespace trocar::virtual_needle
