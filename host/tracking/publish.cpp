#include "host/tracking/publish.hpp"

#include <array>
#include <vector>

#include "common/core/contracts.hpp"
#include "common/wire/dds.hpp"

namespace trocar::tracking {
namespace {

// The message's sequence of `size` numbers, which `from` owns.
template <class Number, class Sequence>
void lend(std::vector<Number>& from, Sequence& to, std::size_t size) {
  from.resize(size);
  to._buffer = from.data();
  to._length = to._maximum = static_cast<std::uint32_t>(size);
  to._release = false;
}

}  // namespace

struct Publisher::Entities {
  Entities(std::uint32_t domain, const optics::MarkerGrid& grid) : participant(domain), writer(participant) {
    message.protocol = protocol_version;
    message.rows = static_cast<std::uint32_t>(grid.rows);
    message.columns = static_cast<std::uint32_t>(grid.columns);
    const std::size_t markers = message.rows * message.columns;
    lend(valid, message.valid, markers);
    lend(number[0], message.score, markers);
    lend(number[1], message.u_px, markers);
    lend(number[2], message.v_px, markers);
    lend(number[3], message.x_m, markers);
    lend(number[4], message.y_m, markers);
    lend(number[5], message.xx_m2, markers);
    lend(number[6], message.xy_m2, markers);
    lend(number[7], message.yy_m2, markers);
  }
  wire::Participant participant;
  wire::Writer<wire::Markers> writer;
  wire::Markers message{};
  std::vector<std::uint8_t> valid{};
  std::array<std::vector<float>, 8> number{};
};

Publisher::Publisher(std::uint32_t domain, const optics::MarkerGrid& grid) : entities_(std::make_unique<Entities>(domain, grid)) {}
Publisher::~Publisher() = default;

void Publisher::publish(const TrackedFrame& frame) {
  Entities& e = *entities_;
  e.message.frame = frame.number;
  e.message.time_ns = frame.time_ns;
  e.message.time_uncertainty_ns = frame.clock == camera::Clock::Rig ? frame.time_uncertainty_ns : -1;
  e.message.frames_lost = frame.counters.lost;
  e.message.frames_dropped = frame.counters.dropped;
  e.message.track_ms = static_cast<float>(frame.track_ms);
  for (std::size_t k = 0; k < e.valid.size(); ++k) {
    const Marker& m = frame.markers[k];
    const MetricMarker& p = frame.metric[k];
    e.valid[k] = m.valid ? 1 : 0;
    const std::array<double, 8> numbers{m.score, m.u_px, m.v_px, p.x_m, p.y_m, p.covariance[0], p.covariance[1], p.covariance[2]};
    for (std::size_t c = 0; c < numbers.size(); ++c) e.number[c][k] = static_cast<float>(numbers[c]);
  }
  (void)e.writer.write(e.message);  // best effort: a reader that sleeps holds nobody up
}

}  // namespace trocar::tracking
