#include <gtest/gtest.h>

#include <random>

#include "made_up_run.hpp"

namespace {

using namespace trocar;
using namespace trocar::report;

class SummaryAtAngle : public testing::TestWithParam<double> {};

// Insertion straight ahead and aslant: nothing may depend on the direction.
TEST_P(SummaryAtAngle, FindsTheForcesThatWerePutIn) {
  const made_up::Truth truth;
  const auto run = made_up::make(truth, GetParam());
  const Summary s = summarise(run.info, run.samples);
  ASSERT_EQ(s.insertions.size(), 3u);
  for (std::size_t i = 0; i < 2; ++i) {
    const Insertion& insertion = s.insertions[i];
    const double slope = truth.slope_n_per_m + 8.0 * static_cast<double>(i);
    ASSERT_TRUE(insertion.fit.has_value());
    EXPECT_NEAR(insertion.fit->slope_n_per_m, slope, 1e-8);
    EXPECT_NEAR(insertion.fit->intercept_n, truth.intercept_n, 1e-9);
    EXPECT_NEAR(insertion.fit->residual_rms_n, 0.0, 1e-9);
    EXPECT_NEAR(insertion.depth_m, truth.depth_m, 5e-6);
    EXPECT_NEAR(insertion.full_depth_force_n, truth.intercept_n + slope * (truth.depth_m - 0.00025), slope * 5e-6);
    EXPECT_NEAR(insertion.withdrawal_force_n, truth.pull_n, 1e-12);
    EXPECT_NEAR(insertion.insert.rms_m, truth.phantom_error_m, 1e-12);
    EXPECT_NEAR(insertion.withdraw.rms_m, truth.phantom_error_m, 1e-12);
  }
  EXPECT_TRUE(std::isnan(s.insertions[2].withdrawal_force_n)) << "there is no withdrawal with the thesis's gains";
}
INSTANTIATE_TEST_SUITE_P(Directions, SummaryAtAngle, testing::Values(std::numbers::pi / 2, 1.2, 2.0));

TEST(Summary, SlopeIsTheLeastSquaresSlopeOfNoisyForces) {
  auto run = made_up::make();
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.0125);
  for (Sample& s : run.samples) s.base_wrench[1] += noise(random);
  const Summary s = summarise(run.info, run.samples);
  // The normal equations, solved the long way round, over the same samples.
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const Sample& sample : samples_of(run.info.phases[1], run.samples)) {
    const double depth = sample.pose[1] + 0.10 - 0.20;
    if (depth < 0.020 || depth > 0.065) continue;
    n += 1;
    sx += depth;
    sy += sample.base_wrench[1];
    sxx += depth * depth;
    sxy += depth * sample.base_wrench[1];
  }
  EXPECT_NEAR(s.insertions[0].fit->slope_n_per_m, (n * sxy - sx * sy) / (n * sxx - sx * sx), 1e-6);
  EXPECT_NEAR(s.insertions[0].fit->residual_rms_n, 0.0125, 0.0005);
  EXPECT_NEAR(s.insertions[0].fit->slope_n_per_m, 34.0, 0.05);
}

TEST(Summary, GivesNoSlopeForAnInsertionThatDoesNotCoverTheRange) {
  made_up::Truth truth;
  truth.depth_m = 0.060;
  const auto run = made_up::make(truth);
  EXPECT_FALSE(summarise(run.info, run.samples).insertions[0].fit.has_value());
}

TEST(Summary, TrackingIsKeptApartByGainsAndPlace) {
  const made_up::Truth truth;
  const auto run = made_up::make(truth);
  const Summary s = summarise(run.info, run.samples);
  ASSERT_EQ(s.tracking.size(), 2u);
  EXPECT_EQ(s.tracking[0].gain_set, "default");
  EXPECT_EQ(s.tracking[0].air.ticks, 3000u);
  EXPECT_NEAR(s.tracking[0].air.rms_m, truth.air_error_m, 1e-12);
  EXPECT_NEAR(s.tracking[0].phantom.max_m, truth.phantom_error_m, 1e-12);
  EXPECT_NEAR(s.tracking[0].air.rms_rad, 1e-4, 1e-12);
  EXPECT_EQ(s.tracking[1].gain_set, "thesis");
  EXPECT_EQ(s.tracking[1].air.ticks, 0u);
  EXPECT_TRUE(std::isnan(s.tracking[1].air.rms_m));
}

TEST(Summary, SagIsMeasuredAtRestBesideForceOverGain) {
  const made_up::Truth truth;
  const auto run = made_up::make(truth);
  const Summary s = summarise(run.info, run.samples);
  ASSERT_EQ(s.sags.size(), 1u) << "the dwell alone: the insertion before it leads to the same rest";
  const double force = truth.intercept_n + truth.slope_n_per_m * truth.depth_m;
  EXPECT_EQ(s.sags[0].phase, "thesis dwell");
  EXPECT_NEAR(s.sags[0].force_n, force, 1e-9);
  EXPECT_NEAR(s.sags[0].expected_m, force / 800.0, 1e-12);
  EXPECT_NEAR(s.sags[0].error_m, (force + truth.friction_n) / 800.0, 1e-12);
  EXPECT_NEAR(s.sags[0].expected_command_m, s.sags[0].error_m, 1e-12);
}

TEST(Summary, PercentilesAreNearestRanks) {
  auto run = made_up::make();
  run.samples.resize(1000);  // 1 … 1000, each once, rotated
  Summary s = summarise(run.info, run.samples);
  EXPECT_EQ(s.tick_us.p50, 500.0);
  EXPECT_EQ(s.tick_us.p99, 990.0);
  EXPECT_EQ(s.tick_us.p99_99, 1000.0);
  EXPECT_EQ(s.tick_us.max, 1000.0);
  EXPECT_EQ(s.wakeup_late_us.p99, 1980.0);
  const auto thousand = run.samples;
  run.samples.clear();
  for (std::size_t i = 0; i < 10000; ++i) {
    run.samples.push_back(thousand[i % 1000]);
    run.samples.back().tick = i + 1;
  }
  run.samples[5000].tick_us = 5000.0F;  // one of ten thousand
  s = summarise(run.info, run.samples);
  EXPECT_EQ(s.tick_us.p99_99, 1000.0);
  EXPECT_EQ(s.tick_us.max, 5000.0);
  run.info.lockstep = true;
  s = summarise(run.info, run.samples);
  EXPECT_EQ(s.tick_us.count, 0u);
}

TEST(Summary, CountsWhatIsMissing) {
  auto run = made_up::make();
  run.samples.erase(run.samples.begin() + 100, run.samples.begin() + 130);
  run.samples.erase(run.samples.begin() + 500, run.samples.begin() + 501);
  for (std::size_t i = 700; i < 703; ++i) run.samples[i].missed_feedback = static_cast<std::uint32_t>(i - 699);
  run.samples[900].missed_feedback = 1;
  for (std::size_t i = 0; i < 20; ++i) {  // before the drives are started nothing is missing
    run.samples[i].mode = Mode::Off;
    run.samples[i].missed_feedback = static_cast<std::uint32_t>(i + 1);
  }
  run.samples[901].fault = Fault::ForceLimit;
  const Summary s = summarise(run.info, run.samples);
  EXPECT_EQ(s.lost_ticks, 31u);
  EXPECT_EQ(s.gaps, 2u);
  EXPECT_EQ(s.ticks_without_feedback, 4u);
  EXPECT_EQ(s.longest_without_feedback, 3u);
  EXPECT_EQ(s.faults, (std::vector<std::string>{"ForceLimit"}));
}

TEST(Summary, LooksOnlyBehindTheLastRestart) {
  const auto run = made_up::make();
  std::vector<Sample> both(run.samples.begin(), run.samples.begin() + 2000);
  for (Sample& s : both) s.base_wrench[1] = 99.0;
  both.insert(both.end(), run.samples.begin(), run.samples.end());
  const Summary s = summarise(run.info, both);
  EXPECT_EQ(s.restarts, 1u);
  EXPECT_EQ(s.lost_ticks, 0u);
  EXPECT_EQ(s.samples, run.samples.size());
  EXPECT_NEAR(s.insertions[0].fit->slope_n_per_m, 34.0, 1e-8);
}

TEST(Summary, StepIsTheMotionOfOneCount) {
  auto run = made_up::make();
  run.samples.resize(400);
  run.info.phases.clear();
  // One count moves the base by 30 um; every fifth tick two count at once and must not be taken for one.
  std::int32_t counts = 0;
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    counts += i % 5 == 0 ? 2 : 1;
    run.samples[i].position_counts = {-counts, 0, 0, 0};
    run.samples[i].pose[0] = 30e-6 * counts;
    run.samples[i].pose[1] = 0.1;
  }
  EXPECT_NEAR(summarise(run.info, run.samples).step_m, 30e-6, 1e-12);
}

TEST(Summary, FindsWhatTheHandFelt) {
  const made_up::HapticTruth truth;
  const auto run = made_up::make_haptic(truth);
  const Summary s = summarise(run.info, run.samples);
  EXPECT_TRUE(s.insertions.empty());
  EXPECT_TRUE(s.tracking.empty());
  ASSERT_EQ(s.displays.size(), 2u);
  const HapticDisplay& d = s.displays[0];
  EXPECT_EQ(d.name, "impedance");
  EXPECT_EQ(d.ticks, 2000u) << "without those before the mode was Haptic";
  EXPECT_NEAR(d.duration_s, 1.999, 1e-12);
  EXPECT_NEAR(d.depth_m, truth.depth_m, 1e-12);
  EXPECT_NEAR(d.force_n, truth.stiffness_n_per_m * truth.depth_m, 1e-12);
  EXPECT_NEAR(d.difference.rms_n, truth.friction_n + truth.estimate_error_n, 1e-12);
  EXPECT_EQ(d.at_rest.ticks, 1500u);
  EXPECT_NEAR(d.least_energy_j, -0.001, 1e-7);
  EXPECT_EQ(d.unsolved_ticks, 1u);
  EXPECT_EQ(d.most_contacts, 8u);
  EXPECT_EQ(d.observer.ticks, 2000u);
  EXPECT_NEAR(d.observer.rms_n, truth.estimate_error_n, 1e-12);
  EXPECT_NEAR(d.true_difference.rms_n, truth.friction_n, 1e-12);
  EXPECT_TRUE(std::isnan(d.observer_rise_s)) << "a hand that pushes smoothly has no step";
  EXPECT_NEAR(s.displays[1].observer_rise_s, 1e-3 * truth.rise_ticks, 1e-12);
}

TEST(Summary, KnowsNoObserverErrorWithoutTruth) {
  auto run = made_up::make_haptic();
  run.info.truth.clear();
  const Summary s = summarise(run.info, run.samples);
  EXPECT_EQ(s.displays[1].observer.ticks, 0u);
  EXPECT_TRUE(std::isnan(s.displays[1].observer.rms_n));
  EXPECT_TRUE(std::isnan(s.displays[1].observer_rise_s));
  EXPECT_FALSE(std::isnan(s.displays[1].difference.rms_n));
}

TEST(Summary, EmptyRecordingGivesNoNumbersAndNoCrash) {
  RunInfo info;
  info.phases.push_back({"insert", Phase::Kind::Insert, 0.001, "default", 0, 100});
  const Summary s = summarise(info, {});
  EXPECT_EQ(s.samples, 0u);
  ASSERT_EQ(s.insertions.size(), 1u);
  EXPECT_TRUE(std::isnan(s.insertions[0].full_depth_force_n));
  EXPECT_TRUE(std::isnan(s.step_m));
  EXPECT_TRUE(std::isnan(s.tick_us.p50));
}

}  // namespace
