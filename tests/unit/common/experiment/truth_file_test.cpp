#include "common/experiment/truth_file.hpp"

#include "file_fixture.hpp"

namespace trocar::experiment {
namespace {

class TruthFileTest : public config::testing::FileFixture {};

TEST_F(TruthFileTest, ComesBackToTheBitAndOnlyWhole) {
  const auto path = folder_ / "truth.csv";
  const Truth first{5, 5'000'000, {0.1, -2.0 / 3.0, 1e-5}, {0.01, 0.12, 1.5707963267948966}};
  Truth second = first;
  second.tick = 6;
  {
    TruthFile file(path);
    file.write(first);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_)) << "without finish() nothing stays";
  TruthFile file(path);
  file.write(first);
  file.write(second);
  EXPECT_FALSE(std::filesystem::exists(path));
  file.finish();
  const auto back = read_truth(path);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].tick, 5U);
  EXPECT_EQ(back[0].time_ns, 5'000'000);
  EXPECT_EQ(back[0].hand_wrench, first.hand_wrench);
  EXPECT_EQ(back[0].pose, first.pose);
  EXPECT_EQ(back[1].tick, 6U);
}

TEST_F(TruthFileTest, RefusesWhatItIsNot) {
  config::testing::expect_parts(error_of("t_s,x_m\n0,1\n", [](const auto& file) { return read_truth(file); }),
                                {"file.toml:1", "tick,time_ns"});
}

}  // namespace
}  // namespace trocar::experiment
