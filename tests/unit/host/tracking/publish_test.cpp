#include "host/tracking/publish.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <thread>

#include "common/wire/dds.hpp"

namespace trocar::tracking {
namespace {

TEST(Publisher, AReaderGetsEveryMarkerOfAFrameByRowAndColumn) {
  const std::uint32_t domain = 100U + static_cast<std::uint32_t>(getpid()) % 100U;
  optics::MarkerGrid grid;
  grid.rows = 2;
  grid.columns = 3;
  Publisher publisher(domain, grid);
  const wire::Participant participant(domain);
  wire::Reader<wire::Markers> reader(participant);
  std::vector<Marker> markers(6);
  std::vector<MetricMarker> metric(6);
  for (std::size_t k = 0; k < 6; ++k) {
    const auto x = static_cast<double>(k);
    markers[k] = {true, 100.0 + x, 200.0 + x, 0.5, {}};
    metric[k] = {0.001 * x, 0.002 * x, {1e-12, 2e-13, 3e-12}};
  }
  markers[4] = {false, std::nan(""), std::nan(""), 0.1, {}};
  TrackedFrame frame{.number = 41, .time_ns = 7'000'000'000, .time_uncertainty_ns = 5000, .clock = camera::Clock::Rig};
  frame.markers = markers;
  frame.metric = metric;
  frame.counters = {.frames = 40, .lost = 1, .dropped = 2};
  frame.track_ms = 5.5;
  bool seen = false;
  for (int k = 0; k < 500 && !seen; ++k) {
    publisher.publish(frame);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    reader.take([&](const wire::Markers& m) {
      if (seen) return;
      seen = true;
      EXPECT_EQ(m.frame, 41U);
      EXPECT_EQ(m.time_ns, 7'000'000'000);
      EXPECT_EQ(m.time_uncertainty_ns, 5000);
      EXPECT_EQ(m.rows, 2U);
      EXPECT_EQ(m.columns, 3U);
      EXPECT_EQ(m.frames_lost, 1U);
      EXPECT_EQ(m.frames_dropped, 2U);
      EXPECT_EQ(m.track_ms, 5.5F);
      for (const auto* length : {&m.score._length, &m.u_px._length, &m.v_px._length, &m.x_m._length, &m.y_m._length, &m.xx_m2._length,
                                 &m.xy_m2._length, &m.yy_m2._length, &m.valid._length})
        ASSERT_EQ(*length, 6U);
      EXPECT_EQ(m.u_px._buffer[grid.index(1, 2)], 105.0F);
      EXPECT_EQ(m.v_px._buffer[grid.index(0, 1)], 201.0F);
      EXPECT_EQ(m.x_m._buffer[3], 0.003F);
      EXPECT_EQ(m.y_m._buffer[3], 0.006F);
      EXPECT_EQ(m.xy_m2._buffer[5], 2e-13F);
      EXPECT_EQ(m.score._buffer[4], 0.1F);
      EXPECT_EQ(m.valid._buffer[4], 0);
      EXPECT_TRUE(std::isnan(m.u_px._buffer[4]));
    });
  }
  EXPECT_TRUE(seen);
  // Without the rig's clock it is not said that it is.
  frame.clock = camera::Clock::Camera;
  frame.number = 42;
  std::optional<std::int64_t> uncertainty;
  for (int k = 0; k < 500 && !uncertainty; ++k) {
    publisher.publish(frame);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    reader.take([&](const wire::Markers& m) {
      if (m.frame == 42) uncertainty = m.time_uncertainty_ns;
    });
  }
  EXPECT_EQ(uncertainty, -1);
}

}  // namespace
}  // namespace trocar::tracking
