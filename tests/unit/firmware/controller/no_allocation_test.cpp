// A program of its own, because it replaces the allocator: no tick allocates, whatever happens in it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <new>

#include "common/condense/compile.hpp"
#include "common/scene/scene.hpp"
#include "fake_rig.hpp"

namespace {
thread_local bool in_tick = false;
thread_local std::size_t allocations_in_tick = 0;
thread_local std::size_t allocations_outside = 0;
}  // namespace

extern "C" {
void* __libc_malloc(std::size_t);
void* malloc(std::size_t size) {  // Eigen and C libraries do not come through operator new
  ++(in_tick ? allocations_in_tick : allocations_outside);
  return __libc_malloc(size);
}
}

namespace trocar::controller {
namespace {

void tick(FakeRig& f, int n) {
  for (int i = 0; i < n; ++i) {
    f.now_ns += FakeRig::ms;
    f.mail->commands.push({.session = FakeRig::host, .kind = CommandKind::KeepAlive});
    in_tick = true;
    f.out = f.controller->tick({f.now_ns, f.late_ns, &f.feedback});
    in_tick = false;
  }
}

TEST(NoAllocation, InAnyTick) {
  FakeRig f;
  const std::size_t before = allocations_outside;
  { const auto counted = std::make_unique<FakeRig>(); }
  ASSERT_GT(allocations_outside, before);  // the trap works
  f.positioned();
  f.mail->commands.push({.session = FakeRig::host, .id = 1, .kind = CommandKind::Tare});
  tick(f, 300);
  f.mail->commands.push({.session = FakeRig::host,
                         .id = 2,
                         .kind = CommandKind::Move,
                         .target_pose = {0.0, 0.121, f.pose[2]},
                         .speed_m_s = 0.05,
                         .angular_speed_rad_s = 1.0});
  tick(f, 100);
  EXPECT_EQ(f.mode(), Mode::Position);
  f.feedback.complete = false;
  tick(f, 30);
  EXPECT_EQ(f.fault(), Fault::FeedbackLost);
  f.feedback.complete = true;
  f.mail->commands.push({.session = FakeRig::host, .id = 3, .kind = CommandKind::ResetFault});
  tick(f, 100);
  f.mail->commands.push({.session = FakeRig::host, .id = 4, .kind = CommandKind::Home});
  tick(f, 10);
  EXPECT_TRUE(f.controller->status().homed);
  EXPECT_EQ(allocations_in_tick, 0u);
}

// The tip stands in the virtual tissue; models are taken, displays change, hold and back.
TEST(NoAllocation, InAnyTickOfHaptic) {
  scene::Scene scene = scene::read_scene(std::filesystem::path(TROCAR_SHARE) / "scenes/phantom.toml");
  for (double& y : scene.tissue.grid->axis_m[1]) y -= 0.03;
  condense::Options options;
  options.visible = condense::WithVisible::No;
  const image_file::AlignedBytes bytes = condense::compile_to_memory(scene, options).image;
  model::Image image{};
  ASSERT_EQ(model::open(bytes.span(), image), model::ImageStatus::Ok);
  image.needle.elements = 24;  // 22G
  image.needle.bending_nm2 = 2.3e-3;
  image.needle.axial_n = 5e4;
  const model::Image other = image;
  FakeRig f("ubc_twin_haptic");
  f.needle.offer(&image);
  f.positioned();
  allocations_in_tick = 0;
  std::uint32_t id = 1;
  for (const Display display : {Display::FourChannel, Display::Impedance, Display::Admittance}) {
    f.mail->commands.push({.session = FakeRig::host, .id = id++, .kind = CommandKind::Haptic, .display = display});
    tick(f, 200);
    EXPECT_EQ(f.mode(), Mode::Haptic);
    EXPECT_GT(f.controller->sample().virtual_contacts, 1u);
  }
  f.needle.offer(&other);
  tick(f, 50);
  EXPECT_EQ(f.needle.using_image(), &other);
  f.mail->commands.push({.session = FakeRig::host, .id = id++, .kind = CommandKind::Hold});
  tick(f, 50);
  EXPECT_EQ(f.mode(), Mode::Hold);
  EXPECT_EQ(allocations_in_tick, 0u);
}

}  // namespace
}  // namespace trocar::controller
