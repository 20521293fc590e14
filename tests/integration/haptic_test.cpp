// Haptic mode with the real programs: a compiled scene, a rig that maps it, a command that lets a hand feel it.
#include <gtest/gtest.h>

#include <signal.h>

#include <cmath>
#include <fstream>

#include "harness.hpp"
#include "host/rig/client.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

constexpr double answer_s = 30.0;

TEST(Haptic, ACompiledSceneIsFeltUntilCtrlC) {
  const Scratch scratch;
  const std::string domain = std::to_string(own_domain());
  const auto image = scratch / "phantom.image";
  Program compile(scratch, "trocar", {"scene", "compile", "phantom", "--out", image.string()});
  ASSERT_EQ(compile.wait(answer_s), 0) << compile.errors();
  const std::string rig_file = scratch.make_rig().string();
  Program plant(scratch, "trocar-plant", {"--rig", rig_file});
  ASSERT_TRUE(plant.wait_for("before scene", answer_s)) << plant.errors();
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort", "--model", image.string()});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();

  host::RigClient client(own_domain());
  (void)client.wait_for_rig(answer_s);
  const double end = steady_s() + answer_s;
  while (client.ask(CommandKind::Home, 5.0).reply.code != ReplyCode::Done) ASSERT_LT(steady_s(), end);
  Program feel(scratch, "trocar", {"rig", "haptic", "--domain", domain, "--display", "impedance"});
  ASSERT_TRUE(feel.wait_for("the handle is the virtual needle's (impedance)", answer_s)) << feel.errors();
  Sample seen;
  while (!(seen.mode == Mode::Haptic) && steady_s() < end) client.poll(0.01, {.sample = [&](const Sample& s) { seen = s; }});
  ASSERT_EQ(seen.mode, Mode::Haptic) << to_string(seen.fault);
  EXPECT_TRUE(std::isfinite(seen.handle_wrench[1]));
  EXPECT_NEAR(seen.virtual_pose[0], seen.pose[0], 0.02);
  feel.signal(SIGINT);
  EXPECT_EQ(feel.wait(answer_s), 0) << feel.errors();
}

TEST(Haptic, IsRefusedWithoutAModelAndWithADamagedOne) {
  const Scratch scratch;
  const std::string domain = std::to_string(own_domain());
  const std::string rig_file = scratch.make_rig().string();
  const auto damaged = scratch / "damaged.image";
  std::ofstream(damaged) << "this is no image";
  expect_refusal(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort", "--model", damaged.string()},
                 {"damaged.image"});
  Program plant(scratch, "trocar-plant", {"--rig", rig_file});
  ASSERT_TRUE(plant.wait_for("before scene", answer_s)) << plant.errors();
  Program rig(scratch, "trocar-rig", {"--rig", rig_file, "--domain", domain, "--best-effort"});
  ASSERT_TRUE(rig.wait_for("DDS domain", answer_s)) << rig.errors();
  host::RigClient client(own_domain());
  (void)client.wait_for_rig(answer_s);
  const double end = steady_s() + answer_s;
  while (client.ask(CommandKind::Home, 5.0).reply.code != ReplyCode::Done) ASSERT_LT(steady_s(), end);
  expect_refusal(scratch, "trocar", {"rig", "haptic", "--domain", domain}, {"refused Haptic", "--model IMAGE"});
}

}  // namespace
}  // namespace trocar::testing
