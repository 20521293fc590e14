#include "firmware/virtual_needle/virtual_needle.hpp"

namespace trocar::virtual_needle {

using mechanism::Vec3;

VirtualNeedle::VirtualNeedle(const control::FadeConfig& fade)
    : own_model_(std::make_unique<insertion::Insertion>()), model_(own_model_.get()), fade_config_(fade) {
  fade_.time_s = fade_config_.duration_s;
}

VirtualNeedle::VirtualNeedle(insertion::Insertion& model, const control::FadeConfig& fade) noexcept : model_(&model), fade_config_(fade) {
  fade_.time_s = fade_config_.duration_s;
}

void VirtualNeedle::take() noexcept {
  const model::Image* const offered = offered_.load(std::memory_order_acquire);
  if (offered == nullptr || offered == used_.load(std::memory_order_relaxed)) return;
  model_->open(*offered);
  result_ = {};
  swapped_ = true;
  used_.store(offered, std::memory_order_release);
}

bool VirtualNeedle::ready() noexcept {
  take();
  return used_.load(std::memory_order_relaxed) != nullptr;
}

void VirtualNeedle::start() noexcept {
  if (ready()) model_->reset();
  wrench_.setZero();
  fade_ = {Vec3::Zero(), fade_config_.duration_s};
  swapped_ = false;
  unsolved_ = 0;
}

Vec3 VirtualNeedle::step(const Vec3& base_pose, double dt_s) noexcept {
  if (!ready()) return Vec3::Zero();
  result_ = model_->step({base_pose[0], base_pose[1], base_pose[2]}, dt_s);
  unsolved_ = result_.status > insertion::Status::TipLost ? unsolved_ + 1 : 0;
  const Vec3 model(result_.base.fx_n, result_.base.fy_n, result_.base.tau_nm);
  if (swapped_) control::begin(fade_, wrench_, model);
  swapped_ = false;
  return wrench_ = control::update(fade_config_, fade_, model, dt_s);
}

}  // namespace trocar::virtual_needle
