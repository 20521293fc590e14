// A person at a haptic rig pushes a flexible needle into a virtual block, moves it about in there and draws it out, again and again: the
// real controller, and the simulated machine without its wire. In-process drives: encoder counts and torques in permille as the drives
// have them, but no frame is sent; a bus of 1 Mbit/s ends at 1.3 kHz.
//   feedback of tick k: what the encoders show at k T.   torque of tick k: acts from (k + 1) T to (k + 2) T, as over the bus
// Simulated time is k T however late the tick runs, so a course has the same bits every time, paced or not.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "common/model/image.hpp"
#include "common/rig/rig.hpp"
#include "common/scene/scene.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"
#include "hal/output_gate.hpp"
#include "hal/rig_link.hpp"
#include "sim_plant/hand/hand.hpp"
#include "sim_plant/plant/plant.hpp"

namespace trocar::bench {

inline constexpr std::uint32_t contacts_goal = 32;
inline constexpr double cycle_s = 7.5;  // in, about, out

// The scene as a model image, written to `file`. Throws config::UserError.
void compile_model(const std::filesystem::path& file);

// What the needle's step did in a tick.
struct Counts {
  std::uint32_t contacts{};
  std::int32_t newton{}, solves{}, pivots{};
  bool solved{};
  friend bool operator==(const Counts&, const Counts&) = default;
};

class Course {
 public:
  // image must outlive the course. Homes, tares, arms and enters Haptic; throws std::runtime_error when the controller refuses, or when
  // its force observer is not admissible at this rate.
  Course(double tick_hz, const model::Image& image);

  // What a tick is given, and where its command goes. begin, controller().tick(input), end.
  [[nodiscard]] controller::TickInput begin(std::int64_t wakeup_late_ns) noexcept;
  [[nodiscard]] controller::Controller& controller() noexcept { return *controller_; }
  void end(const hal::LinkCommand& command) noexcept;

  [[nodiscard]] Counts counts() const noexcept;  // of the last tick
  [[nodiscard]] bool haptic() noexcept { return controller_->sample().mode == Mode::Haptic; }
  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  [[nodiscard]] const rig::Rig& rig() const noexcept { return rig_; }

 private:
  void run(int ticks) noexcept;
  void send(Command command, int ticks, Mode expected);
  void intend(const std::array<double, 3>& from);
  void measure() noexcept;

  rig::Rig rig_;
  std::int64_t period_ns_;
  controller::Mailboxes mail_;
  virtual_needle::VirtualNeedle needle_;
  std::unique_ptr<controller::Controller> controller_;
  sim_plant::Plant plant_;
  sim_plant::Hand hand_;
  hal::OutputGate gate_;
  hal::Feedback feedback_{};
  std::array<double, capacity::drives> acting_nm_{};  // of the motors, in this period
  hal::DriveRequest request_{};
  std::int64_t now_ns_{};
  bool held_{};
  std::uint32_t id_{};
};

}  // namespace trocar::bench
