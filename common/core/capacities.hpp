// Compile-time capacities of everything that the real-time side stores. A rig or scene that needs more is refused
// on the host, by name. Nothing in the tick grows beyond these.
#pragma once

#include <cstddef>

namespace trocar::capacity {

inline constexpr std::size_t drives = 4;              // active joints of the twin; a single five-bar uses the first two
inline constexpr std::size_t gain_sets = 4;           // named PID gain sets in one rig description
inline constexpr std::size_t name = 32;               // bytes of a name, terminator included
inline constexpr std::size_t sample_ring = 4096;      // samples between the tick and the bridge: 4 s at 1 kHz
inline constexpr std::size_t command_ring = 64;       // host commands waiting for a tick
inline constexpr std::size_t event_ring = 256;        // events and replies waiting for the bridge
inline constexpr std::size_t flight_recorder = 1000;  // samples kept for the moment of a fault
inline constexpr std::size_t can_queue = 256;         // frames waiting in one bus direction

}  // namespace trocar::capacity
