// Batches of samples as they come over the network: cut into samples, or refused; the bytes of each are those of the batch.
#include <cstring>

#include "common/capture/cdr.hpp"
#include "common/wire/convert.hpp"
#include "property.hpp"

using namespace trocar;
using fuzz::require;

namespace {

template <class T>
void decode(std::span<const std::byte> cdr) {
  try {
    const capture::Decoded<T> value(cdr);
    (void)*value;
  } catch (const capture::CdrError& refusal) {
    require(refusal.what()[0] != '\0', "a refusal says why");
  }
}

template <class Batch>
void split(std::span<const std::byte> cdr) {
  try {
    const capture::Decoded<Batch> batch(cdr);
    const auto samples = capture::split_batch<Batch>(cdr);
    require(samples.size() == batch->samples._length && samples.size() <= wire::BatchBuffer::capacity, "a batch is cut into its samples");
    std::size_t bytes = 0;
    for (const auto& sample : samples) {
      require(sample.size() >= 8, "a sample has a header and a length");
      bytes += sample.size() - 8;
      decode<wire::Sample>(sample);
    }
    require(bytes <= cdr.size() + 4 * samples.size() || cdr[1] == std::byte{8}, "no more comes out than went in");
  } catch (const capture::CdrError& refusal) {
    require(refusal.what()[0] != '\0', "a refusal says why");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto cdr = std::as_bytes(std::span(data, size)).subspan(1);
  switch (data[0] % 7) {
    case 0:
      split<wire::SampleBatch>(cdr);
      break;
    case 1:
      split<wire::FlightBatch>(cdr);
      break;
    case 2:
      decode<wire::Status>(cdr);
      break;
    case 3:
      decode<wire::Event>(cdr);
      break;
    case 4:
      decode<wire::Command>(cdr);
      break;
    case 5:
      decode<wire::Reply>(cdr);
      break;
    default:
      decode<wire::Markers>(cdr);
      break;
  }
  return 0;
}
