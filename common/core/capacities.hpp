// Compile-time capacities of everything that the real-time side stores. A rig or scene that needs more is refused
// on the host, by name. Nothing in the tick grows beyond these.
#pragma once

#include <cstddef>

namespace trocar::capacity {

// Samples between the tick and the bridge, 4 s at 1 kHz; nodes moved by mesh adaptation. TROCAR_SMALL_MEMORY, a microcontroller with some 4
// MB, has fewer; of contacts as many as a PC, because they are part of a model image's format.
#ifdef TROCAR_SMALL_MEMORY
inline constexpr std::size_t sample_ring = 64;
inline constexpr std::size_t adapted_nodes = 8;
#else
inline constexpr std::size_t sample_ring = 4096;
inline constexpr std::size_t adapted_nodes = 40;
#endif

inline constexpr std::size_t drives = 4;                   // active joints of the twin; a single five-bar uses the first two
inline constexpr std::size_t gain_sets = 4;                // named PID gain sets in one rig description
inline constexpr std::size_t name = 32;                    // bytes of a name, terminator included
inline constexpr std::size_t command_ring = 64;            // host commands waiting for a tick
inline constexpr std::size_t stop_ring = 8;                // Stop commands waiting for a tick
inline constexpr std::size_t event_ring = 256;             // events and replies waiting for the bridge
inline constexpr std::size_t flight_recorder = 1000;       // samples kept for the moment of a fault, its own included
inline constexpr std::size_t flight_aftermath = 100;       // samples kept after it
inline constexpr std::size_t can_queue = 256;              // frames waiting in one bus direction
inline constexpr std::size_t contacts = 64;                // contact points between needle and tissue; 2 unknowns each
inline constexpr std::size_t embedding_nodes = 32;         // nodes that one contact is tied to
inline constexpr std::size_t needle_elements = 64;         // of a needle that bends; 2 unknowns each
inline constexpr std::size_t needle_loads = contacts + 4;  // forces on a needle: its contacts, the tip, some to spare; a multiple of 4
inline constexpr std::size_t velocity_law_rows = 16;       // points of a force density over speed
inline constexpr std::size_t cells_per_bucket = 64;        // candidate cells that one search looks at
inline constexpr std::size_t ring_cells = 12;              // cells around a node that mesh adaptation may move
inline constexpr std::size_t patch_nodes = 9;              // nodes of the cells around a node that mesh adaptation may move

}  // namespace trocar::capacity
