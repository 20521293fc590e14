#include "firmware/control/fade.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::control {
namespace {

using mechanism::Vec3;
constexpr double dt = 1e-3;

TEST(Fade, BeginsAtTheLastOutputAndEndsAtTheLaw) {
  const FadeConfig config{0.5};
  FadeState s;
  const Vec3 last(3.0, -1.0, 0.05), law(-2.0, 0.5, 0.0);
  begin(s, last, law);
  Vec3 out = update(config, s, law, dt);
  EXPECT_LT((out - last).cwiseAbs().maxCoeff(), 1e-15);
  for (int k = 1; k < 250; ++k) out = update(config, s, law, dt);
  EXPECT_NEAR(update(config, s, law, dt)[0], 0.5, 1e-9);  // half of the time, half of the way
  for (int k = 251; k <= 501; ++k) out = update(config, s, law, dt);
  EXPECT_EQ(out, law);
}

TEST(Fade, StepsStayWithinTheStatedBound) {
  const FadeConfig config{0.5};
  FadeState s;
  const Vec3 law = Vec3::Zero();
  begin(s, {16.0, 0.0, 0.0}, law);
  double before = 16.0, most = 0.0;
  for (int k = 0; k < 600; ++k) {
    const double out = update(config, s, law, dt)[0];
    most = std::max(most, std::abs(out - before));
    EXPECT_LE(out, before + 1e-12);
    before = out;
  }
  EXPECT_LE(most, 1.5 * 16.0 * dt / 0.5 * (1 + 1e-9));
  EXPECT_LT(most, 0.05);
}

TEST(Fade, TheLawActsWholeFromTheFirstTick) {
  const FadeConfig config{0.5};
  FadeState s;
  begin(s, {5.0, 0.0, 0.0}, Vec3::Zero());
  const double first = update(config, s, {0.0, 0.0, 0.0}, 0.0)[0];
  EXPECT_NEAR(update(config, s, {-1.0, 0.0, 0.0}, 0.0)[0], first - 1.0, 1e-12);
}

TEST(Fade, NoDurationNoFade) {
  FadeState s;
  begin(s, {5.0, 0.0, 0.0}, Vec3::Zero());
  EXPECT_EQ(update({0.0}, s, {1.0, 0.0, 0.0}, dt), Vec3(1.0, 0.0, 0.0));
}

}  // namespace
}  // namespace trocar::control
