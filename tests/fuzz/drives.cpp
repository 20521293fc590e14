// A whole drives bus: the master of four drives hears frames of any kind at any time (TPDO, heartbeat, emergency, SDO answers), and its own
// are checked. Some of the time a simulated drive stands at the other end, so that the bring-up goes on.
#include <array>

#include "byte_source.hpp"
#include "hal/canopen/master.hpp"
#include "property.hpp"

using namespace trocar;
using namespace trocar::hal::canopen;
using fuzz::require;
using hal::CanFrame;

namespace {

rig::Rig make_rig() {
  rig::Rig rig;
  rig.kind = rig::Kind::Twin;
  rig.actuation.torque_constant_nm_per_a = 0.0525;
  rig.actuation.continuous_current_a = 2.0;
  rig.actuation.peak_current_a = 10.0;
  rig.actuation.gear_ratio = {5, 5, 10, 10};
  rig.actuation.gear_efficiency = 0.8;
  rig.actuation.encoder_counts_per_turn = 16000;
  rig.timing.tick_hz = 1000;
  rig.timing.heartbeat_ms = 20;
  rig.timing.heartbeat_timeout_ms = 60;
  rig.buses.bitrate_bps = 1'000'000;
  rig.buses.drive_node = {1, 2, 3, 4};
  rig.buses.master_node = 127;
  rig.buses.sensor_base_id = 0x1B0;
  return rig;
}
const rig::Rig the_rig = make_rig();
const Master new_master{the_rig};
const std::array<DriveSetup, 4> setups{make_drive_setup(the_rig, 0), make_drive_setup(the_rig, 1), make_drive_setup(the_rig, 2),
                                       make_drive_setup(the_rig, 3)};
constexpr int most_ticks = 256;  // longer than a bring-up of one drive

void check_sent(const CanFrame& frame, DriveRequest request) {
  require(frame.length <= 8 && !frame.extended && !frame.remote && !frame.error && frame.id <= 0x7FF, "a master sends plain data frames");
  const std::uint32_t node = frame.id & 0x7F;
  const bool to_drive = node >= 1 && node <= 4;
  const bool known = frame.id == cob_nmt || frame.id == cob_heartbeat(127) ||
                     (to_drive && (frame.id == cob_sdo_request(static_cast<std::uint8_t>(node)) ||
                                   frame.id == cob_controlword(static_cast<std::uint8_t>(node))));
  require(known, "a master sends to nobody but its drives");
  if (to_drive && (frame.id & 0x780) == 0x300 && request != DriveRequest::Enable)
    require(hal::load<std::uint16_t>(frame, 0) != control::enable_operation, "torque is enabled only when that is asked for");
}

// What a willing drive would say to the frame.
CanFrame willing_answer(const CanFrame& sent) {
  CanFrame answer{.id = 0x7FF, .length = 8};
  if (sent.id == cob_nmt) {
    const std::uint8_t node = sent.data[1];
    const bool start = sent.data[0] == static_cast<std::uint8_t>(NmtCommand::Start);
    return heartbeat_frame(node, start ? NmtState::Operational : NmtState::BootUp);
  }
  if ((sent.id & 0x780) != 0x600) return answer;
  const auto node = static_cast<std::uint8_t>(sent.id & 0x7F);
  const Object object{hal::load<std::uint16_t>(sent, 1), sent.data[3], 0};
  if ((sent.data[0] & 0xE0) == 0x20) return sdo_download_answer(node, object);
  const DriveSetup& setup = setups[static_cast<std::size_t>(node - 1) % 4];
  for (std::size_t i = setup.steps; i-- > 0;) {
    const SetupStep& step = setup.step[i];
    if (step.object == object && step.expect != SetupStep::Expect::Skip) return sdo_upload_answer(node, step.object, step.value);
  }
  return answer;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteSource in(data, size);
  Master master = new_master;
  int ticks = 0;
  std::int64_t now_ns = 0;
  for (int step = 0; step < 48 && !in.empty(); ++step) {
    const auto action = in.take<std::uint8_t>();
    const auto request = static_cast<DriveRequest>((action >> 2) % 3);
    if ((action & 1) != 0) {  // a frame, most often one that a drive of this rig sends
      CanFrame frame = in.frame();
      if ((action & 2) != 0) {
        constexpr std::array<std::uint32_t, 4> kind{0x080, 0x180, 0x580, 0x700};
        frame.id = kind[(frame.id >> 3) & 3] + 1 + (frame.id & 3);
        frame.extended = frame.remote = frame.error = false;
        frame.length = (frame.id & 0x780) == 0x700 ? 1 : 8;
      }
      const bool ours = master.receive(frame, now_ns);
      require(!ours || (!frame.extended && !frame.remote && !frame.error), "a drive sends plain data frames");
    } else {  // ticks, with willing drives or none
      for (int tick = 0; tick < 1 + (action >> 5) * 8 && ticks < most_ticks; ++tick, ++ticks) {
        now_ns += ns_per_ms;
        master.supervise(now_ns);
        master.clear_fresh();
        CanFrame sent;
        if (!master.next_frame(now_ns, request, (action & 16) != 0, sent)) continue;
        check_sent(sent, request);
        if ((action & 2) != 0) (void)master.receive(willing_answer(sent), now_ns);
      }
    }
    for (std::size_t i = 0; i < master.drives(); ++i) {
      const DriveMaster& drive = master.drive(i);
      require(drive.phase() <= DrivePhase::Pause && drive.state() <= DriveState::Unknown, "a state that has a name");
      require(drive.report().node == i + 1, "a drive keeps its node");
    }
    require(!master.all_enabled() || master.operational(), "no drive is enabled that is not operational");
  }
  const std::size_t blocking = master.blocking_drive();
  require(blocking <= master.drives(), "a drive of the rig, or none");
  if (blocking < master.drives()) {
    std::array<char, 384> text{};
    const std::size_t length = describe(master.drive(blocking).report(), text);
    require(length > 0 && length < text.size() && text[length] == '\0', "a report fits its line");
  }
  return 0;
}
