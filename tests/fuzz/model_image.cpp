// The reader of model images: a refused one leaves the running one alone, and an accepted one survives being written and read again.
#include <algorithm>
#include <cmath>

#include "common/model/image.hpp"
#include "image_bytes.hpp"
#include "property.hpp"

using namespace trocar;
using fuzz::require;

#ifdef TROCAR_FUZZ
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  return fuzz::mutate_image(data, size, max_size, seed);
}
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static model::testing::TinyImage tiny;
  static const model::testing::Bytes running_bytes = tiny.bytes();
  static const model::Slot running_slot = [] {
    model::Slot slot;
    require(slot.swap(running_bytes.span()) == model::ImageStatus::Ok, "the image to begin with is good");
    return slot;
  }();
  model::Slot slot = running_slot;
  const model::Image& running = *running_slot.image();

  const model::testing::Bytes bytes = fuzz::aligned(data, size);
  const model::ImageStatus status = slot.swap(bytes.span());
  require(model::to_string(status) != nullptr, "every status has a text");
  const model::Image& image = *slot.image();
  if (status != model::ImageStatus::Ok) {
    require(image.checksum == running.checksum && image.law == running.law && image.tissue.node_m.data() == running.tissue.node_m.data(),
            "a refused image leaves the running one");
    return 0;
  }
  for (const auto& cell : image.tissue.cell)
    for (std::size_t k = 0; k < cell.count; ++k) require(cell.node[k] < image.tissue.node_m.size(), "cells name nodes that are there");
  for (const auto& node : image.tissue.node_m) require(std::isfinite(node[0]) && std::isfinite(node[1]), "nodes are finite");
  for (const double c : image.tissue.compliance64) require(std::isfinite(c), "compliance is finite");
  for (const float c : image.tissue.compliance32) require(std::isfinite(c), "compliance is finite");

  require(model::image_size(image) == size, "an accepted image has the size of its content");
  if (image.checksum % 16 != 0) return 0;  // of some suffices what follows: it costs as much as all the rest
  // Not the same bytes: what lies in gaps and padding is not content.
  const model::testing::Bytes copy(size);
  model::write(image, copy.span());
  model::Image again{};
  require(model::open(copy.span(), again) == model::ImageStatus::Ok, "an accepted image can be written and read again");
  const model::testing::Bytes second(size);
  model::write(again, second.span());
  require(std::ranges::equal(copy.span(), second.span()), "writing is the same every time");
  return 0;
}
