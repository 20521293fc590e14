#include "tests/benchmarks/realtime/cyclictest.hpp"

#include <gtest/gtest.h>

namespace trocar::bench {
namespace {

TEST(Cyclictest, HistogramAndWhatIsBeyondIt) {
  const CyclictestResult r = parse_cyclictest(
      "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000001 000007\n000002 000990\n# Total: 000000997\n"
      "# Min Latencies: 00001\n# Avg Latencies: 00002\n# Max Latencies: 04321\n# Histogram Overflows: 00003\n"
      "# Histogram Overflow at cycle number:\n# Thread 0: 00017 00018 00300\n\n");
  ASSERT_EQ(r.count.size(), 3u);
  EXPECT_EQ(r.count[0], 0);
  EXPECT_EQ(r.count[1], 7);
  EXPECT_EQ(r.count[2], 990);
  EXPECT_EQ(r.beyond, 3);
  EXPECT_EQ(r.most_us, 4321.0);
}

TEST(Cyclictest, NothingOfWhatIsNoHistogram) {
  const CyclictestResult r = parse_cyclictest("WARN: stat /dev/cpu_dma_latency failed\n");
  EXPECT_TRUE(r.count.empty());
  EXPECT_EQ(r.beyond, 0);
}

}  // namespace
}  // namespace trocar::bench
