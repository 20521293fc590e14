// `trocar rig …`: look at a rig file, look at a running rig, arm, hold and stop it.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

namespace trocar::cli {

int rig_info(const std::string& rig, bool json);
int rig_status(std::uint32_t domain, bool json);
int rig_home(std::uint32_t domain);
// Arms, keeps the session alive and prints what happens until `stop`; then disarms.
int rig_arm(std::uint32_t domain, std::atomic<bool>& stop);
// The same, and the handle becomes the virtual needle's. `display`: four_channel, impedance or admittance.
int rig_haptic(std::uint32_t domain, const std::string& display, std::atomic<bool>& stop);
int rig_hold(std::uint32_t domain);
int rig_stop(std::uint32_t domain);
int rig_reset(std::uint32_t domain);

}  // namespace trocar::cli
