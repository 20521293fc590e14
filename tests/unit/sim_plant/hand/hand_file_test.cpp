#include "sim_plant/hand/hand_file.hpp"

#include <cmath>
#include <iterator>

#include "file_fixture.hpp"

namespace trocar::sim_plant {
namespace {

using config::testing::edited;
using config::testing::expect_parts;
using Vector3 = Hand::Vector3;

constexpr double dt = 1e-4;
constexpr Vector3 home{0.01, 0.12, 1.0};

class HandFile : public config::testing::FileFixture {
 protected:
  static std::string shipped() {
    std::ifstream file(std::filesystem::path(TROCAR_SHARE) / "hands/person.toml");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void expect_refusal(const char* from, const char* to, std::initializer_list<std::string> parts) {
    const auto edit = edited(shipped(), from, to);
    const std::string message = error_of(edit.text, [](const auto& file) { return read_hand(file, 1); });
    expect_parts(message, {edit.line});
    expect_parts(message, parts);
  }
};

// The handle stands still where `home` is: what the hand wants shows in where it would go.
TEST_F(HandFile, TakesTheHandleAfterTheMotorsCameOnAndGoesItsWay) {
  Hand hand = read_hand(write(shipped()), 1);
  const auto at = [&](double from_s, double to_s, bool on) {
    for (double t = from_s; t < to_s - 0.5 * dt; t += dt) {
      hand.notice(on, t, home);
      hand.advance(t, home, {}, dt);
    }
  };
  at(0.0, 2.0, false);
  EXPECT_FALSE(hand.holds());
  EXPECT_EQ(hand.wrench(), Vector3{});
  at(2.0, 2.49, true);
  EXPECT_FALSE(hand.holds());
  at(2.49, 2.52, true);
  ASSERT_TRUE(hand.holds());
  // Rests 1 s, pushes 3 s, rests 1 s, draws 3 s; 75 mm along the needle from where it was taken at 2.5 s; then anew.
  const double taken = 2.5;
  const auto along = [&](double t) {
    const Vector3 w = hand.wanted(taken + t);
    EXPECT_EQ(w[2], home[2]);
    EXPECT_NEAR(-(w[0] - home[0]) * std::sin(home[2]) + (w[1] - home[1]) * std::cos(home[2]), 0.0, 1e-12);
    return (w[0] - home[0]) * std::cos(home[2]) + (w[1] - home[1]) * std::sin(home[2]);
  };
  for (const double cycle : {0.0, 8.0, 80.0}) {
    EXPECT_NEAR(along(cycle + 0.9), 0.0, 1e-12);
    EXPECT_NEAR(along(cycle + 2.5), 0.0375, 1e-4);
    EXPECT_NEAR(along(cycle + 4.5), 0.075, 1e-12);
    EXPECT_NEAR(along(cycle + 6.5), 0.0375, 1e-4);
    EXPECT_NEAR(along(cycle + 8.0), 0.0, 1e-9);
  }
  // It lets go with the motors, and takes the handle again.
  at(2.52, 2.6, false);
  EXPECT_FALSE(hand.holds());
  EXPECT_EQ(hand.wrench(), Vector3{});
  at(3.0, 3.6, true);
  EXPECT_TRUE(hand.holds());
  EXPECT_NEAR((hand.wanted(3.5 + 4.5)[0] - home[0]) * std::cos(home[2]) + (hand.wanted(3.5 + 4.5)[1] - home[1]) * std::sin(home[2]), 0.075,
              1e-12);
}

TEST_F(HandFile, SameSeedSameTremorAnotherSeedAnother) {
  const auto file = write(edited(shipped(), "take_after_s = 0.5", "take_after_s = 0.0").text);
  const auto felt = [&](std::uint64_t seed) {
    Hand hand = read_hand(file, seed);
    for (int k = 0; k < 1000; ++k) {
      hand.notice(true, k * dt, home);
      hand.advance(k * dt, home, {}, dt);
    }
    return hand.wrench();
  };
  EXPECT_EQ(felt(1), felt(1));
  EXPECT_NE(felt(1), felt(2));
}

TEST_F(HandFile, RefusesWhatIsWrongWithPlaceAndRemedy) {
  expect_refusal("mass_kg = 1.0", "mass_kg = -1.0", {"mass_kg", "-1"});
  expect_refusal("forward_m = 0.075", "forward_mm = 75", {"forward_mm", "forward_m = 0.075"});
  expect_refusal("push_speed_m_s = 0.025", "push_speed_m_s = 0.0", {"push_speed_m_s", "such as 0.025"});
  expect_refusal("tremor_hz = 10.0", "tremor_hz = \"a lot\"", {"tremor_hz", "a lot"});
  expect_refusal("rest_in_s = 1.0", "mood = 3\nrest_in_s = 1.0", {"mood"});
  expect_refusal("take_after_s = 0.5", "replay = 3\ntake_after_s = 0.5", {"replay", "truth.csv"});
  // A recording leaves nothing to want.
  const auto both = edited(shipped(), "take_after_s = 0.5", "take_after_s = 0.5\nreplay = \"none.csv\"");
  expect_parts(error_of(both.text, [](const auto& file) { return read_hand(file, 1); }), {"file.toml:", "tremor_hz"});
}

TEST_F(HandFile, ReplaysARecordingFromItsFirstForceOn) {
  std::ofstream(folder_ / "truth.csv") << "tick,time_ns,hand_fx_n,hand_fy_n,hand_tau_nm,x_m,y_m,theta_rad\n"
                                          "1,0,0,0,0,0,0,0\n2,500000000,0,0,0,0,0,0\n"
                                          "3,1000000000,1,2,0.1,0,0.1,1.5\n4,1500000000,3,4,0.3,0.01,0.1,1.5\n";
  Hand hand = read_hand(write("take_after_s = 0.25\nreplay = \"truth.csv\"\n"), 1);
  hand.notice(true, 10.0, home);
  EXPECT_EQ(hand.advance(10.0, home, {}, dt), Vector3{});
  hand.notice(true, 10.25, home);
  EXPECT_EQ(hand.advance(10.25, home, {}, dt), (Vector3{1.0, 2.0, 0.1}));
  hand.notice(true, 10.5, home);
  const Vector3 between = hand.advance(10.5, {}, {}, dt);
  EXPECT_NEAR(between[0], 2.0, 1e-12);
  EXPECT_NEAR(between[1], 3.0, 1e-12);
  hand.notice(true, 11.0, home);
  EXPECT_EQ(hand.advance(11.0, home, {}, dt), Vector3{});
}

// The force of then where the handle is as then; elsewhere the arm's impedance on top of it.
TEST_F(HandFile, ReplaysWithAnArmAboutTheRecordedMotion) {
  std::ofstream(folder_ / "truth.csv") << "time_ns,hand_fx_n,hand_fy_n,hand_tau_nm,x_m,y_m,theta_rad\n"
                                          "0,1,0,0,0.01,0.10,1.0\n1000000000,1,0,0,0.03,0.10,1.0\n";
  Hand hand = read_hand(write("take_after_s = 0.0\nreplay = \"truth.csv\"\n[arm]\nstiffness_n_per_m = 200.0\ndamping_n_s_per_m = 10.0\n"
                              "stiffness_nm_per_rad = 0.3\ndamping_nm_s_per_rad = 0.01\n"),
                        1);
  hand.notice(true, 0.0, home);
  const Vector3 same = hand.advance(0.5, {0.02, 0.10, 1.0}, {0.02, 0.0, 0.0}, dt);
  EXPECT_NEAR(same[0], 1.0, 1e-12);
  EXPECT_NEAR(same[1], 0.0, 1e-12);
  EXPECT_NEAR(same[2], 0.0, 1e-12);
  const Vector3 other = hand.advance(0.5, {0.015, 0.11, 1.2}, {0.0, 0.1, -1.0}, dt);
  EXPECT_NEAR(other[0], 1.0 + 200.0 * 0.005 + 10.0 * 0.02, 1e-12);
  EXPECT_NEAR(other[1], -200.0 * 0.01 - 10.0 * 0.1, 1e-12);
  EXPECT_NEAR(other[2], -0.3 * 0.2 + 0.01 * 1.0, 1e-12);
  EXPECT_EQ(hand.advance(1.5, home, {}, dt), Vector3{});
}

TEST_F(HandFile, ReadsTheEstimateOfSamplesToo) {
  std::ofstream(folder_ / "samples.csv")
      << "tick,time_ns,mode,x_m,y_m,theta_rad,handle_fx_n,handle_fy_n,handle_tau_nm\n"
         "1,0,Armed,nan,nan,nan,nan,nan,nan\n2,1000000,Haptic,0.01,0.1,1.5,0.5,0,0\n3,2000000,Haptic,0.01,0.1,1.5,0.25,0,0\n"
         "4,3000000,Ready,0.01,0.1,1.5,nan,nan,nan\n";
  const auto recording = read_recording(folder_ / "samples.csv");
  ASSERT_EQ(recording.size(), 3U);
  EXPECT_EQ(recording[0].time_s, 0.0);
  EXPECT_EQ(recording[0].wrench[0], 0.5);
  EXPECT_NEAR(recording[2].time_s, 0.002, 1e-15);
  EXPECT_EQ(recording[2].wrench, Vector3{});
  EXPECT_EQ(recording[0].pose, (Vector3{0.01, 0.1, 1.5}));
}

TEST_F(HandFile, RefusesARecordingThatIsNone) {
  const auto error = [&](std::string_view text) { return error_of(text, [](const auto& file) { return read_recording(file); }); };
  const std::string head = "time_ns,hand_fx_n,hand_fy_n,hand_tau_nm,x_m,y_m,theta_rad\n";
  expect_parts(error("t_s,x_m\n0,1\n"), {"file.toml:1", "time_ns", "truth.csv"});
  expect_parts(error("time_ns,hand_fx_n\n0,1\n"), {"file.toml:1", "hand_fy_n"});
  expect_parts(error(head + "0,1,1\n"), {"file.toml:2", "3 fields instead of 7"});
  expect_parts(error(head + "0,1,one,1,0,0,0\n"), {"file.toml:2", "hand_fy_n", "one"});
  expect_parts(error(head + "0,1,1,1,0,0,0\n0,1,1,1,0,0,0\n"), {"file.toml:3", "time_ns", "increase"});
  expect_parts(error(head + "0,1,1,1,nan,0,0\n"), {"file.toml:2", "pose", "cut the recording off"});
  expect_parts(error(head + "0,0,0,0,0,0,0\n"), {"file.toml", "no hand pushes"});
  expect_parts(error_from([&] { (void)read_recording(folder_ / "none.csv"); }), {"none.csv", "cannot be read"});
}

}  // namespace
}  // namespace trocar::sim_plant
