// Topic names, types and quality of service: the one place that writer, reader and recorder agree on. No DDS header in here.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace trocar::wire {

struct Topic {
  const char* name{};
  const char* type{};  // as in rig.idl
  bool reliable{};
  bool transient_local{};  // a late reader still gets the last `depth` values
  std::uint32_t depth{};   // samples kept per writer and reader; 0 keeps all
  bool from_host{};        // written by hosts; the others by the rig alone

  // By name: literals of one text may have several addresses in a program.
  friend constexpr bool operator==(const Topic& a, const Topic& b) noexcept { return std::string_view(a.name) == b.name; }
};

// Samples: a lost batch is history, resending would only delay the next; deep, so that a reader may sleep for seconds.
inline constexpr Topic samples_topic{"rig/samples", "trocar::wire::SampleBatch", false, false, 1024};
// Flight recordings: every sample counts, and whoever comes after the fault still gets the last recording (11 batches).
inline constexpr Topic flight_topic{"rig/flight", "trocar::wire::FlightBatch", true, true, 11};
// Status and events: whoever joins late must know the present state and how it came about.
inline constexpr Topic status_topic{"rig/status", "trocar::wire::Status", true, true, 1};
inline constexpr Topic events_topic{"rig/events", "trocar::wire::Event", true, true, 256};
// Commands and replies: every one counts, and none may act on a program that starts later.
inline constexpr Topic command_topic{"rig/command", "trocar::wire::Command", true, false, 0, true};
inline constexpr Topic reply_topic{"rig/reply", "trocar::wire::Reply", true, false, 0};

// Markers: as samples, from whoever tracks them.
inline constexpr Topic markers_topic{"camera/markers", "trocar::wire::Markers", false, false, 256, true};

inline constexpr std::array<Topic, 7> topics{samples_topic, flight_topic, status_topic, events_topic,
                                             command_topic, reply_topic,  markers_topic};

// The text of rig.idl as this program was built with.
[[nodiscard]] std::string_view idl_text() noexcept;

}  // namespace trocar::wire
