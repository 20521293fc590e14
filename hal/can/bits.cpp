#include "hal/can/bits.hpp"

namespace trocar::hal {
namespace {

class StuffedBits {
 public:
  // Most significant bit first. The checksum covers the bits as they are before stuffing.
  void push(std::uint32_t value, std::uint32_t bits) noexcept {
    for (std::uint32_t i = bits; i-- > 0;) {
      const std::uint32_t bit = (value >> i) & 1u;
      const std::uint32_t feedback = bit ^ ((crc_ >> 14) & 1u);
      crc_ = (crc_ << 1) & 0x7FFFu;
      if (feedback != 0) crc_ ^= 0x4599u;
      put(bit);
    }
  }
  [[nodiscard]] std::uint32_t crc() const noexcept { return crc_; }
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }

 private:
  void put(std::uint32_t bit) noexcept {
    ++count_;
    run_ = bit == last_ ? run_ + 1 : 1;
    last_ = bit;
    if (run_ == 5) {  // the stuff bit starts a run of its own
      ++count_;
      last_ = bit ^ 1u;
      run_ = 1;
    }
  }
  std::uint32_t crc_{}, count_{}, run_{}, last_{2};
};

}  // namespace

std::uint32_t can_bits(const CanFrame& frame) noexcept {
  StuffedBits bits;
  bits.push(0, 1);
  if (frame.extended) {
    bits.push((frame.id >> 18) & 0x7FFu, 11);
    bits.push(0b11, 2);  // substitute remote request, identifier extension
    bits.push(frame.id & 0x3FFFFu, 18);
    bits.push(frame.remote ? 1 : 0, 1);
    bits.push(0, 2);  // r1, r0
  } else {
    bits.push(frame.id & 0x7FFu, 11);
    bits.push(frame.remote ? 1 : 0, 1);
    bits.push(0, 2);  // identifier extension, r0
  }
  bits.push(frame.length, 4);
  if (!frame.remote)
    for (std::size_t i = 0; i < frame.length && i < frame.data.size(); ++i) bits.push(frame.data[i], 8);
  bits.push(bits.crc(), 15);
  return bits.count() + 13;
}

}  // namespace trocar::hal
