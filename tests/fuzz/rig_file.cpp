// Rig files: refused in one line, or a rig with which drives can be set up and a controller can tick.
#include <cmath>
#include <memory>

#include "common/config/rig_file.hpp"
#include "common/config/user_error.hpp"
#include "common/rig/bus_budget.hpp"
#include "firmware/controller/controller.hpp"
#include "hal/canopen/drive_setup.hpp"
#include "memory_file.hpp"

using namespace trocar;
using fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path file = fuzz::memory_file(data, size);
  rig::Rig rig;
  try {
    rig = config::read_rig(file);
  } catch (const config::UserError& refusal) {
    fuzz::require_message(refusal.what(), file);
    return 0;
  }
  require(rig.gain_sets >= 1 && rig.gain_sets <= capacity::gain_sets, "a rig has gains");
  require(rig.timing.tick_hz > 0.0 && std::isfinite(rig.timing.tick_hz), "a rig ticks");
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    const double torque_nm = rig.actuation.joint_torque_nm(rig.actuation.peak_current_a, i);
    require(std::isfinite(torque_nm) && torque_nm > 0.0, "every drive has torque");
    const hal::canopen::DriveSetup setup = hal::canopen::make_drive_setup(rig, i);
    require(setup.steps > 0 && setup.steps <= setup.step.size(), "the set-up fits its table");
    require(rig.buses.drive_node[i] >= 1 && rig.buses.drive_node[i] <= 127, "a node id of CANopen");
  }
  const rig::BusBudget budget = rig::bus_budget(rig);
  require(std::isfinite(budget.drives_peak_percent + budget.sensor_percent),
          "a bus has a load");  // whether it fits, `trocar rig check` says
  if (rig.kind != rig::Kind::Twin) return 0;

  static const auto mail = std::make_unique<controller::Mailboxes>();
  controller::Controller controller(rig, *mail, true);
  hal::Feedback feedback{};
  feedback.drives = rig.drives();
  feedback.state = hal::LinkState::Operational;
  feedback.complete = true;
  for (auto& drive : feedback.drive) drive.fresh = drive.heartbeat_ok = true;
  for (std::int64_t tick = 1; tick <= 3; ++tick) {
    const hal::LinkCommand& out = controller.tick({tick * 1'000'000, 0, &feedback});
    for (const double torque : out.joint_torque_nm) require(torque == 0.0, "no torque without being armed");
    require(controller.status().fault != Fault::NotFinite, "a rig makes no infinite numbers");
  }
  Sample sample;
  while (mail->samples.pop(sample)) continue;
  Event event;
  while (mail->events.pop(event)) continue;
  return 0;
}
