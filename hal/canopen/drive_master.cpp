#include "hal/canopen/drive_master.hpp"

#include <algorithm>

namespace trocar::hal::canopen {

DriveMaster::DriveMaster(const rig::Rig& rig, std::size_t drive) noexcept
    : node_{rig.buses.drive_node[drive]},
      heartbeat_timeout_ns_{rig.timing.heartbeat_timeout_ms * ns_per_ms},
      setup_{make_drive_setup(rig, drive)},
      sdo_{node_} {
  report_.drive = static_cast<std::uint8_t>(drive);
  report_.node = node_;
}

void DriveMaster::enter(DrivePhase phase, std::int64_t now_ns) noexcept {
  report_.phase = phase;
  phase_since_ns_ = now_ns;
  if (phase == DrivePhase::Configure) {
    step_ = 0;
    written_ = false;
    sdo_.reset();
  } else if (phase == DrivePhase::WaitHeartbeat) {
    feedback_seen_ = false;
    word_sent_ = false;
    last_word_ = control::disable_voltage;
  } else if (phase == DrivePhase::Running) {
    report_.problem = DriveProblem::None;
    report_.remedy = nullptr;
    last_heartbeat_ns_ = now_ns;
  }
}

void DriveMaster::fail(DriveProblem problem, std::int64_t now_ns) noexcept {
  report_.problem = problem;
  sdo_.reset();
  enter(DrivePhase::Pause, now_ns);
}

void DriveMaster::blame_step(const char* remedy) noexcept {
  report_.object = step().object;
  report_.reading_back = written_ || !step().write;
  report_.remedy = remedy;
}

void DriveMaster::receive(const CanFrame& frame, std::int64_t now_ns) noexcept {
  if (frame.id == cob_feedback(node_)) {
    if (frame.length != 8) {
      ++counters_.malformed;
      return;
    }
    position_counts_ = load<std::int32_t>(frame, 0);
    torque_permille_ = load<std::int16_t>(frame, 4);
    statusword_ = load<std::uint16_t>(frame, 6);
    fresh_ = true;
    feedback_seen_ = true;
  } else if (frame.id == cob_sdo_response(node_)) {
    if (sdo_.receive(frame) && !waits_for_sdo()) finish_exchange(now_ns);
  } else if (frame.id == cob_heartbeat(node_)) {
    if (frame.length != 1) {
      ++counters_.malformed;
      return;
    }
    heartbeat(static_cast<NmtState>(frame.data[0] & 0x7F), now_ns);
  } else if (frame.id == cob_emergency(node_)) {
    if (frame.length != 8) {
      ++counters_.malformed;
      return;
    }
    emergency_code_ = load<std::uint16_t>(frame, 0);
    if (emergency_code_ != emcy_none) ++counters_.emergencies;
  }
}

void DriveMaster::heartbeat(NmtState state, std::int64_t now_ns) noexcept {
  last_heartbeat_ns_ = now_ns;
  if (state == NmtState::BootUp) {
    const bool expected = report_.phase == DrivePhase::WaitBoot || report_.phase == DrivePhase::Reset || report_.phase == DrivePhase::Pause;
    if (!expected) {
      ++counters_.reboots;
      report_.problem = DriveProblem::Rebooted;
      report_.remedy = "check the drive's supply";
    }
    emergency_code_ = emcy_none;
    enter(DrivePhase::Configure, now_ns);
    return;
  }
  if (report_.phase == DrivePhase::WaitHeartbeat && state == NmtState::Operational) {
    enter(DrivePhase::Running, now_ns);
  } else if (report_.phase == DrivePhase::Running && state != NmtState::Operational) {
    ++counters_.left_operational;
    report_.actual = static_cast<std::uint32_t>(state);
    report_.remedy = "another master may be on the bus, or the drive lost this one's heartbeat";
    fail(DriveProblem::LeftOperational, now_ns);
  }
}

void DriveMaster::finish_exchange(std::int64_t now_ns) noexcept {
  if (sdo_.state() == SdoClient::State::Aborted) {
    ++counters_.sdo_aborts;
    blame_step(step().remedy);
    report_.actual = sdo_.abort_code();
    fail(DriveProblem::SdoAborted, now_ns);
    return;
  }
  if (step().write && !written_) {
    written_ = true;
    if (step().expect != SetupStep::Expect::Skip) {
      sdo_.reset();
      return;  // read it back
    }
  } else {
    const std::uint32_t actual = sdo_.value();
    const std::uint32_t wanted = step().value;
    const std::uint32_t apart = actual > wanted ? actual - wanted : wanted - actual;
    const bool equal = ((actual ^ wanted) & step().mask) == 0;
    const bool near = apart <= std::max<std::uint32_t>(1, wanted / 100);
    const bool good = step().expect == SetupStep::Expect::Anything || (step().expect == SetupStep::Expect::Near ? near : equal);
    if (!good) {
      ++counters_.readback_errors;
      blame_step(step().remedy);
      report_.expected = wanted & step().mask;
      report_.actual = actual & step().mask;
      fail(DriveProblem::ReadsBackWrong, now_ns);
      return;
    }
  }
  sdo_.reset();
  written_ = false;
  if (++step_ == setup_.steps) enter(DrivePhase::Configured, now_ns);
}

void DriveMaster::supervise(std::int64_t now_ns) noexcept {
  const std::int64_t elapsed_ns = now_ns - phase_since_ns_;
  switch (report_.phase) {
    case DrivePhase::WaitBoot:
      if (elapsed_ns >= boot_timeout_ns) {
        ++counters_.boot_timeouts;
        report_.remedy =
            "check its supply, its cable and terminator, its node id, its bit rate; with a simulated plant: is trocar-plant running?";
        fail(DriveProblem::NoBootUp, now_ns);
      }
      break;
    case DrivePhase::Configure:
      if (sdo_.update(now_ns, sdo_timeout_ns) == SdoClient::State::TimedOut) {
        ++counters_.sdo_timeouts;
        blame_step("check its supply and its cable");
        fail(DriveProblem::SdoTimeout, now_ns);
      }
      break;
    case DrivePhase::WaitHeartbeat:
      if (elapsed_ns >= heartbeat_timeout_ns_) {
        report_.remedy = "it was started but does not say so; check its firmware";
        fail(DriveProblem::NoHeartbeat, now_ns);
      }
      break;
    case DrivePhase::Running:
      if (now_ns - last_heartbeat_ns_ >= heartbeat_timeout_ns_) {
        ++counters_.heartbeats_lost;
        report_.remedy = "check its supply and its cable";
        fail(DriveProblem::HeartbeatLost, now_ns);
      }
      break;
    case DrivePhase::Pause:
      if (elapsed_ns >= retry_pause_ns) enter(DrivePhase::Reset, now_ns);
      break;
    default:
      break;
  }
}

bool DriveMaster::bring_up_frame(std::int64_t now_ns, bool may_start, CanFrame& frame) noexcept {
  if (sdo_.next_frame(frame, now_ns)) return true;
  switch (report_.phase) {
    case DrivePhase::Reset:
      frame = nmt_frame(NmtCommand::ResetCommunication, node_);
      enter(DrivePhase::WaitBoot, now_ns);
      return true;
    case DrivePhase::Configure:
      if (sdo_.state() != SdoClient::State::Idle) return false;
      frame = step().write && !written_ ? sdo_.download(step().object, step().value, now_ns) : sdo_.upload(step().object, now_ns);
      return true;
    case DrivePhase::Configured:
      if (!may_start) return false;
      frame = nmt_frame(NmtCommand::Start, node_);
      enter(DrivePhase::WaitHeartbeat, now_ns);
      return true;
    default:
      return false;
  }
}

bool DriveMaster::controlword_frame(std::int64_t now_ns, DriveRequest request, bool reset_fault, CanFrame& frame) noexcept {
  if (!running() || !feedback_seen_) return false;
  const ControlStep next = next_controlword(state(), request, reset_fault, last_word_);
  if (next.reached) return false;
  const bool repeated = word_sent_ && next.word == last_word_;
  const bool reset_pending = word_sent_ && (last_word_ & control::fault_reset) != 0 && state() == DriveState::Fault;
  if ((repeated || reset_pending) && now_ns - word_sent_ns_ < controlword_repeat_ns) return false;
  frame = CanFrame{.id = cob_controlword(node_), .length = 2};
  store(frame, 0, next.word);
  last_word_ = next.word;
  word_sent_ = true;
  word_sent_ns_ = now_ns;
  ++counters_.controlwords;
  return true;
}

}  // namespace trocar::hal::canopen
