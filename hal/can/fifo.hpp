// Fixed-capacity queue within one thread (between threads: common/core/ring.hpp).
#pragma once

#include <array>
#include <cstddef>

namespace trocar::hal {

template <class T, std::size_t Capacity>
class Fifo {
 public:
  [[nodiscard]] bool push(const T& value) noexcept {
    if (size_ == Capacity) return false;
    slots_[(first_ + size_) % Capacity] = value;
    ++size_;
    return true;
  }
  [[nodiscard]] bool pop(T& value) noexcept {
    if (size_ == 0) return false;
    value = slots_[first_];
    drop_front();
    return true;
  }
  [[nodiscard]] const T& front() const noexcept { return slots_[first_]; }  // precondition: not empty
  void drop_front() noexcept {
    first_ = (first_ + 1) % Capacity;
    --size_;
  }
  void clear() noexcept { size_ = 0; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::array<T, Capacity> slots_{};
  std::size_t first_{};
  std::size_t size_{};
};

}  // namespace trocar::hal
