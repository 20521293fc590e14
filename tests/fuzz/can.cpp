// Datagrams of CAN frames (hal/can): taken whole or not at all, and what was taken survives being sent on.
#include <cstring>
#include <vector>

#include "common/rig/bus_budget.hpp"
#include "hal/can/bits.hpp"
#include "hal/can/bus.hpp"
#include "hal/can/candump.hpp"
#include "hal/can/cannelloni.hpp"
#include "property.hpp"

using namespace trocar;
using fuzz::require;

namespace {

void check(const hal::CanFrame& frame, hal::BusCounters& counters) {
  require(frame.length <= 8, "a frame has at most eight bytes");
  require(frame.id <= (frame.extended || frame.error ? 0x1FFF'FFFFu : 0x7FFu), "an identifier has 11 or 29 bits");
  const std::uint32_t data = frame.remote ? 0 : frame.length;
  const std::uint32_t bits = hal::can_bits(frame);
  require(bits <= rig::worst_case_can_bits(data, frame.extended), "no frame takes longer than the worst case");
  require(bits >= (frame.extended ? 67u : 47u) + 8 * data, "no frame takes less time than its bits without stuffing");

  const std::uint64_t before = counters.received + counters.error_frames;
  hal::count_received(counters, frame);
  require(counters.received + counters.error_frames == before + 1, "every frame is counted once");
  require(counters.condition <= hal::BusCondition::Off, "a condition that has a name");

  const hal::CandumpLine line = hal::candump_line(frame, 1'436'509'052'249'713'000, "vcan0");
  const std::size_t size = strnlen(line.data(), line.size());
  require(size < line.size() && size > 0 && line[size - 1] == '\n', "a log line ends in a line feed and a zero");
  const char* hash = std::strchr(line.data(), '#');
  require(hash != nullptr && (frame.remote || size == static_cast<std::size_t>(hash - line.data()) + 2 + std::size_t{2} * data),
          "a log line holds all of the data");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hal::cannelloni::Reader reader;
  hal::CanFrame frame;
  if (!reader.open({data, size})) {
    require(!reader.next(frame) && reader.unsupported() == 0, "a refused datagram gives nothing");
    return 0;
  }
  const std::uint32_t stated = static_cast<std::uint32_t>((data[3] << 8) | data[4]);
  hal::cannelloni::Writer writer;
  hal::BusCounters counters;
  std::vector<hal::CanFrame> sent;
  std::uint32_t frames = 0;
  while (reader.next(frame)) {
    ++frames;
    check(frame, counters);
    if (writer.append(frame)) sent.push_back(frame);
  }
  require(frames + reader.unsupported() == stated, "every frame is given or counted as unsupported");

  const auto datagram = writer.finish(reader.sequence());
  require(datagram.size() <= hal::cannelloni::max_datagram_bytes, "a datagram fits into one Ethernet frame");
  hal::cannelloni::Reader again;
  require(again.open(datagram) && again.sequence() == reader.sequence(), "what is written can be read");
  for (const hal::CanFrame& expected : sent) require(again.next(frame) && frame == expected, "frames survive the tunnel");
  require(!again.next(frame), "no frame is invented");
  return 0;
}
