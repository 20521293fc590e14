#include "firmware/flight/recorder.hpp"

#include <gtest/gtest.h>

namespace trocar::flight {
namespace {

constexpr std::uint64_t before = capacity::flight_recorder;
constexpr std::uint64_t after = capacity::flight_aftermath;

struct FlightRecorderTest : ::testing::Test {
  Recorder recorder;
  std::uint64_t tick{};
  std::vector<Recording> recordings;

  void fly(std::uint64_t ticks, Fault fault = Fault::None) {
    for (std::uint64_t i = 0; i < ticks; ++i) {
      Sample s;
      s.tick = ++tick;
      s.fault = fault;
      s.pose[0] = static_cast<double>(tick);
      if (recorder.push(s)) recordings.push_back(recorder.take());
    }
  }
  // Consecutive from `first` to `last`, each with what belongs to it.
  static void expect_ticks(const Recording& r, std::uint64_t first, std::uint64_t last) {
    ASSERT_EQ(r.samples.size(), last - first + 1);
    for (std::uint64_t t = first; t <= last; ++t) {
      const Sample& s = r.samples[t - first];
      ASSERT_EQ(s.tick, t);
      ASSERT_EQ(s.pose[0], static_cast<double>(t));
      ASSERT_EQ(s.fault, t < r.fault_tick ? Fault::None : r.fault);
    }
  }
};

TEST_F(FlightRecorderTest, HoldsTheThousandSamplesUpToTheFaultAndWhatFollows) {
  fly(12345);
  fly(after, Fault::FeedbackLost);
  EXPECT_TRUE(recordings.empty());  // the aftermath lacks one
  fly(1, Fault::FeedbackLost);
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_EQ(recordings[0].fault, Fault::FeedbackLost);
  EXPECT_EQ(recordings[0].fault_tick, 12346u);
  expect_ticks(recordings[0], 12346 - before + 1, 12346 + after);
}

TEST_F(FlightRecorderTest, OneFaultIsOneRecordingHoweverLongItStays) {
  fly(2000);
  fly(5000, Fault::SensorLost);
  fly(2000);
  EXPECT_EQ(recordings.size(), 1u);
}

// Around the length of the ring: nothing of an earlier lap, nothing missing.
TEST_F(FlightRecorderTest, WrapsRight) {
  for (const std::uint64_t ran :
       {std::uint64_t{0}, std::uint64_t{1}, before - 2, before - 1, before, before + 1, 2 * before - 1, 2 * before}) {
    recorder = {};
    recordings.clear();
    tick = 0;
    fly(ran);
    fly(after + 1, Fault::LateTick);
    ASSERT_EQ(recordings.size(), 1u) << ran;
    expect_ticks(recordings[0], ran + 1 > before ? ran + 2 - before : 1, ran + 1 + after);
  }
}

TEST_F(FlightRecorderTest, EachFaultAfterAResetHasItsRecording) {
  fly(1500);
  fly(150, Fault::EncoderJump);
  fly(50);  // reset
  fly(150, Fault::EncoderJump);
  fly(1);
  fly(150, Fault::ForceLimit);
  ASSERT_EQ(recordings.size(), 3u);
  EXPECT_EQ(recordings[0].fault_tick, 1501u);
  EXPECT_EQ(recordings[1].fault_tick, 1701u);
  EXPECT_EQ(recordings[2].fault_tick, 1852u);
  EXPECT_EQ(recordings[2].fault, Fault::ForceLimit);
  for (const Recording& r : recordings) {
    EXPECT_EQ(r.samples.size(), before + after);
    EXPECT_EQ(r.samples[before - 1].tick, r.fault_tick);
    EXPECT_EQ(r.samples.back().tick, r.fault_tick + after);
  }
}

TEST_F(FlightRecorderTest, AFaultInTheAftermathOfAnotherIsInItsRecording) {
  fly(1500);
  fly(20, Fault::EncoderJump);
  fly(5);
  fly(1000, Fault::ForceLimit);
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_EQ(recordings[0].fault, Fault::EncoderJump);
  EXPECT_EQ(recordings[0].samples.back().fault, Fault::ForceLimit);
}

TEST_F(FlightRecorderTest, EndsWithWhatThereIs) {
  EXPECT_FALSE(recorder.finish());
  fly(1500);
  fly(3, Fault::BusOff);
  ASSERT_TRUE(recorder.finish());
  const Recording r = recorder.take();
  expect_ticks(r, 1501 - before + 1, 1503);
  EXPECT_FALSE(recorder.finish());
}

}  // namespace
}  // namespace trocar::flight
