#include "firmware/safety/faults.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace trocar::safety {
namespace {

TEST(Faults, EveryFaultHasItsRowInTheOrderOfTheEnum) {
  ASSERT_EQ(static_cast<std::size_t>(Fault::TorqueMismatch) + 1, fault_count);
  for (std::size_t i = 0; i < fault_count; ++i) {
    const auto fault = static_cast<Fault>(i);
    EXPECT_EQ(row(fault).fault, fault) << to_string(fault);
    EXPECT_STRNE(to_string(fault), "?");
  }
}

TEST(Faults, EachSaysSomethingOfItsOwn) {
  std::set<std::string> causes;
  for (const FaultRow& r : fault_table) {
    ASSERT_NE(r.cause, nullptr);
    ASSERT_NE(r.remedy, nullptr);
    EXPECT_FALSE(std::string(r.remedy).empty());
    EXPECT_TRUE(causes.insert(r.cause).second) << r.cause;
  }
}

TEST(Faults, WithoutATrustworthyMeasurementThereIsNoTorque) {
  for (const Fault f :
       {Fault::FeedbackLost, Fault::HeartbeatLost, Fault::DriveFault, Fault::EncoderJump, Fault::Inconsistent, Fault::NotFinite})
    EXPECT_EQ(row(f).reaction, Reaction::TorqueOff) << to_string(f);
}

}  // namespace
}  // namespace trocar::safety
