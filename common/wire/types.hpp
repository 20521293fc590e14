// The DDS types by their short names, and which topic carries which.
#pragma once

#include "common/wire/rig.h"
#include "common/wire/topics.hpp"

namespace trocar::wire {

using Sample = trocar_wire_Sample;
using SampleBatch = trocar_wire_SampleBatch;
using FlightBatch = trocar_wire_FlightBatch;
using Status = trocar_wire_Status;
using Event = trocar_wire_Event;
using Command = trocar_wire_Command;
using Reply = trocar_wire_Reply;
using Markers = trocar_wire_Markers;

// How each type is laid out …
template <class T>
[[nodiscard]] const dds_topic_descriptor_t& descriptor() noexcept;
template <>
inline const dds_topic_descriptor_t& descriptor<Sample>() noexcept {
  return trocar_wire_Sample_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<SampleBatch>() noexcept {
  return trocar_wire_SampleBatch_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<FlightBatch>() noexcept {
  return trocar_wire_FlightBatch_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<Status>() noexcept {
  return trocar_wire_Status_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<Event>() noexcept {
  return trocar_wire_Event_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<Command>() noexcept {
  return trocar_wire_Command_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<Reply>() noexcept {
  return trocar_wire_Reply_desc;
}
template <>
inline const dds_topic_descriptor_t& descriptor<Markers>() noexcept {
  return trocar_wire_Markers_desc;
}

// … and the one topic that it travels on, so that the type alone names topic and quality of service. A Sample travels in batches only.
template <class T>
inline constexpr Topic topic_of = {};
template <>
inline constexpr Topic topic_of<SampleBatch> = samples_topic;
template <>
inline constexpr Topic topic_of<FlightBatch> = flight_topic;
template <>
inline constexpr Topic topic_of<Status> = status_topic;
template <>
inline constexpr Topic topic_of<Event> = events_topic;
template <>
inline constexpr Topic topic_of<Command> = command_topic;
template <>
inline constexpr Topic topic_of<Reply> = reply_topic;
template <>
inline constexpr Topic topic_of<Markers> = markers_topic;

template <class T>
concept Topical = topic_of<T>
.name != nullptr;

[[nodiscard]] const dds_topic_descriptor_t& descriptor_of(const Topic& topic);

}  // namespace trocar::wire
