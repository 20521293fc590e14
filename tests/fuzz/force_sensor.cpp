// The force sensor's decoder: a reading is made of two replies to one request and of nothing else, and is finite.
#include <cmath>

#include "byte_source.hpp"
#include "hal/sensor/ati_net_ft.hpp"
#include "property.hpp"

using namespace trocar;
using namespace trocar::hal;
using fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint32_t base = 0x1B0;
  constexpr rig::ForceSensor scale{.counts_per_n = 400, .counts_per_nm = 20000, .angle_rad = 0};
  fuzz::ByteSource in(data, size);
  ati::Client client{base};
  std::uint64_t requests = 0;
  std::uint64_t frames = 0;
  std::uint64_t halves = 0;  // first halves taken
  CanFrame first{};
  for (int step = 0; step < 32 && !in.empty(); ++step) {
    const auto action = in.take<std::uint8_t>();
    if ((action & 3) == 0) {
      require(client.request() == ati::request_frame(base), "a request is the sensor's");
      ++requests;
      continue;
    }
    CanFrame frame = in.frame();
    if ((action & 3) != 1) {
      frame.id = base + 5 + ((action >> 2) & 1);
      frame.extended = frame.remote = frame.error = false;
      frame.length = 8;
    }
    ++frames;
    const ati::Reading before = client.reading();
    const std::uint64_t refused = client.unexpected();
    const bool is_new = client.receive(frame);
    const ati::Reading& reading = client.reading();
    if (client.unexpected() == refused && !is_new) {
      ++halves;
      first = frame;
    }
    if (!is_new) {
      require(reading.counts == before.counts && reading.status == before.status && reading.sample == before.sample,
              "a reading changes only as a whole");
      continue;
    }
    require(reading.counts[0] == load<std::int16_t>(first, 0) && reading.counts[3] == load<std::int16_t>(first, 2) &&
                reading.counts[1] == load<std::int16_t>(first, 4) && reading.counts[4] == load<std::int16_t>(first, 6) &&
                reading.counts[2] == load<std::int16_t>(frame, 0) && reading.counts[5] == load<std::int16_t>(frame, 2),
            "a reading is its two replies");
    for (const double value : reading.force_torque(scale)) require(std::isfinite(value) && std::abs(value) <= 82, "a reading is finite");
    (void)reading.saturated();
  }
  require(client.readings() <= halves && client.readings() <= requests, "no reading without a request");
  require(client.readings() + halves + client.unexpected() == frames, "every frame is counted once");
  return 0;
}
