#include "hal/canopen/master.hpp"

#include <algorithm>
#include <cstdio>

namespace trocar::hal::canopen {
namespace {
constexpr std::uint8_t foreign = capacity::drives;
}

ReceivedIds received_ids(const rig::Rig& rig) noexcept {
  ReceivedIds ids;
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    const std::uint8_t node = rig.buses.drive_node[i];
    for (const std::uint32_t id : {cob_emergency(node), cob_feedback(node), cob_sdo_response(node), cob_heartbeat(node)})
      ids.id[ids.count++] = id;
  }
  return ids;
}

Master::Master(const rig::Rig& rig) noexcept
    : drives_{rig.drives()}, node_{rig.buses.master_node}, heartbeat_period_ns_{rig.timing.heartbeat_ms * ns_per_ms} {
  drive_of_node_.fill(foreign);
  for (std::size_t i = 0; i < drives_; ++i) {
    drive_[i] = DriveMaster{rig, i};
    drive_of_node_[rig.buses.drive_node[i] & 0x7Fu] = static_cast<std::uint8_t>(i);
  }
}

bool Master::receive(const CanFrame& frame, std::int64_t now_ns) noexcept {
  if (frame.extended || frame.remote || frame.error) return false;
  const std::uint8_t i = drive_of_node_[frame.id & 0x7Fu];
  if (i == foreign) return false;
  switch (frame.id & 0x780u) {  // received_ids() has the same four
    case cob_emergency(0):
    case cob_feedback(0):
    case cob_sdo_response(0):
    case cob_heartbeat(0):
      drive_[i].receive(frame, now_ns);
      return true;
    default:
      return false;
  }
}

void Master::supervise(std::int64_t now_ns) noexcept {
  for (std::size_t i = 0; i < drives_; ++i) drive_[i].supervise(now_ns);
}

bool Master::next_frame(std::int64_t now_ns, DriveRequest request, bool reset_faults, CanFrame& frame) noexcept {
  if (reset_faults) reset_until_ns_ = now_ns + reset_window_ns;
  const bool reset = now_ns < reset_until_ns_;
  const bool reserved = answer_due_;
  answer_due_ = false;
  if (request != DriveRequest::Enable) {
    for (std::size_t k = 0; k < drives_; ++k) {
      const std::size_t i = (controlword_turn_ + k) % drives_;
      if (drive_[i].state() == DriveState::Fault || !drive_[i].controlword_frame(now_ns, request, false, frame)) continue;
      controlword_turn_ = i + 1;
      return true;
    }
  }
  if (!heartbeat_started_ || now_ns >= next_heartbeat_ns_) {
    // A late heartbeat does not shift the ones after it, unless a whole period was missed.
    next_heartbeat_ns_ = heartbeat_started_ && now_ns < next_heartbeat_ns_ + heartbeat_period_ns_
                             ? next_heartbeat_ns_ + heartbeat_period_ns_
                             : now_ns + heartbeat_period_ns_;
    heartbeat_started_ = true;
    frame = heartbeat_frame(node_, NmtState::Operational);
    return true;
  }
  if (reserved) return false;
  // Starting waits for all: a drive that runs sends feedback at every SYNC, and the budget then has no room for SDO traffic.
  const bool may_start = std::all_of(drive_.begin(), drive_.begin() + static_cast<std::ptrdiff_t>(drives_),
                                     [](const DriveMaster& drive) { return drive.configured(); });
  for (std::size_t k = 0; k < drives_; ++k) {
    const std::size_t i = (turn_ + k) % drives_;
    if (!drive_[i].bring_up_frame(now_ns, may_start, frame) && !drive_[i].controlword_frame(now_ns, request, reset, frame)) continue;
    answer_due_ = drive_[i].waits_for_sdo();
    turn_ = i + 1;
    return true;
  }
  return false;
}

bool Master::operational() const noexcept {
  for (std::size_t i = 0; i < drives_; ++i)
    if (!drive_[i].running()) return false;
  return true;
}

bool Master::all_enabled() const noexcept {
  for (std::size_t i = 0; i < drives_; ++i)
    if (!drive_[i].running() || drive_[i].state() != DriveState::OperationEnabled) return false;
  return true;
}

std::size_t Master::blocking_drive() const noexcept {
  std::size_t waiting = drives_;
  for (std::size_t i = drives_; i-- > 0;)
    if (!drive_[i].running()) waiting = i;
  for (std::size_t i = 0; i < drives_; ++i)
    if (!drive_[i].running() && drive_[i].report().problem != DriveProblem::None) return i;
  return waiting;
}

std::size_t describe(const DriveReport& report, std::span<char> text) noexcept {
  const unsigned drive = report.drive;
  const unsigned node = report.node;
  const unsigned index = report.object.index;
  const unsigned subindex = report.object.subindex;
  const char* remedy = report.remedy != nullptr ? report.remedy : "";
  int size = 0;
  const auto print = [&](const char* format, auto... values) { size = std::snprintf(text.data(), text.size(), format, values...); };
  switch (report.problem) {
    case DriveProblem::NoBootUp:
      print("drive %u (node %u) does not answer: %s", drive, node, remedy);
      break;
    case DriveProblem::SdoTimeout:
      print("drive %u (node %u) did not answer the %s of object %04Xh:%02X: %s", drive, node, report.reading_back ? "reading" : "writing",
            index, subindex, remedy);
      break;
    case DriveProblem::SdoAborted:
      print("drive %u (node %u) refused the %s of object %04Xh:%02X (%s, abort code %08Xh): %s", drive, node,
            report.reading_back ? "reading" : "writing", index, subindex, to_string(static_cast<SdoAbort>(report.actual)), report.actual,
            remedy);
      break;
    case DriveProblem::ReadsBackWrong:
      print("drive %u (node %u): object %04Xh:%02X reads %u (%Xh) instead of %u (%Xh): %s", drive, node, index, subindex, report.actual,
            report.actual, report.expected, report.expected, remedy);
      break;
    case DriveProblem::NoHeartbeat:
      print("drive %u (node %u) sends no heartbeat: %s", drive, node, remedy);
      break;
    case DriveProblem::HeartbeatLost:
      print("drive %u (node %u): its heartbeat stopped: %s", drive, node, remedy);
      break;
    case DriveProblem::LeftOperational:
      print("drive %u (node %u) left the state Operational by itself (now %Xh): %s", drive, node, report.actual, remedy);
      break;
    case DriveProblem::Rebooted:
      print("drive %u (node %u) restarted by itself: %s", drive, node, remedy);
      break;
    case DriveProblem::None:
      switch (report.phase) {
        case DrivePhase::Configure:
          print("drive %u (node %u): configuring", drive, node);
          break;
        case DrivePhase::Configured:
          print("drive %u (node %u): configured, waits for the others", drive, node);
          break;
        case DrivePhase::WaitHeartbeat:
          print("drive %u (node %u): started, waits for its heartbeat", drive, node);
          break;
        case DrivePhase::Running:
          print("drive %u (node %u): running", drive, node);
          break;
        default:
          print("drive %u (node %u): waits for its boot-up message", drive, node);
          break;
      }
      break;
  }
  return size < 0 || text.empty() ? 0 : std::min(static_cast<std::size_t>(size), text.size() - 1);
}

}  // namespace trocar::hal::canopen
