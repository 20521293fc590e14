// A tick on any image that the reader accepts: the step relies on what open() verified and checks nothing itself.
#include <cmath>
#include <memory>

#include "common/insertion/insertion.hpp"
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
  const model::testing::Bytes bytes = fuzz::aligned(data, size);
  model::Image image{};
  if (model::open(bytes.span(), image) != model::ImageStatus::Ok) return 0;
  static const auto insertion = std::make_unique<insertion::Insertion>();
  insertion->open(image);
  // Down through the patch of tiny_image.hpp, aside, and out again; the needle is as long as the image says.
  constexpr double down = -1.5707963267948966;
  for (const double tip_y_m : {0.025, 0.016, 0.011, 0.006, 0.006, 0.015, 0.03}) {
    const double x_m = tip_y_m < 0.01 ? 0.0105 : 0.01;
    const insertion::Result result = insertion->step({x_m, tip_y_m + image.needle.length_m, down}, 0.001);
    require(result.status <= insertion::Status::NotFinite && insertion::to_string(result.status) != nullptr, "a status that has a name");
    require(insertion->contacts() <= capacity::contacts && result.contacts <= capacity::contacts, "contacts stay within their capacity");
    for (std::size_t i = 0; i < insertion->contacts(); ++i) (void)insertion->contact(i);
  }
  return 0;
}
