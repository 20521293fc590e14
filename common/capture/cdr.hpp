// CDR as it is on the wire: 4 bytes of encapsulation (representation id, options), then XCDR2. The types are appendable, so the
// representation is D_CDR2_LE (00 09): every struct carries its length and fields that a newer writer appended are skipped.
// Uses Cyclone's own serialiser without a participant; the bytes equal those that a DDS reader receives (tested).
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/wire/types.hpp"

namespace trocar::capture {

struct CdrError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

namespace detail {
[[nodiscard]] std::vector<std::byte> serialise(const void* value, const dds_topic_descriptor_t& type);
void deserialise(std::span<const std::byte> cdr, void* value, const dds_topic_descriptor_t& type);
void release(void* value, const dds_topic_descriptor_t& type) noexcept;
}  // namespace detail

template <class T>
[[nodiscard]] std::vector<std::byte> serialise(const T& value) {
  return detail::serialise(&value, wire::descriptor<T>());
}

// A value read from CDR, together with the sequences that it points to.
template <class T>
class Decoded {
 public:
  // Throws CdrError when the bytes are not a T.
  explicit Decoded(std::span<const std::byte> cdr) { detail::deserialise(cdr, &value_, wire::descriptor<T>()); }
  ~Decoded() { detail::release(&value_, wire::descriptor<T>()); }
  Decoded(const Decoded&) = delete;
  Decoded& operator=(const Decoded&) = delete;

  [[nodiscard]] const T& operator*() const noexcept { return value_; }
  [[nodiscard]] const T* operator->() const noexcept { return &value_; }

 private:
  T value_{};
};

// The samples of a SampleBatch or a FlightBatch as messages of their own, each with its header: the bytes of the batch, cut, not encoded
// anew, so that fields which this program does not know survive. Throws CdrError when the bytes are no such batch.
template <class Batch>
[[nodiscard]] std::vector<std::vector<std::byte>> split_batch(std::span<const std::byte> cdr);

}  // namespace trocar::capture
