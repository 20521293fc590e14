// The DDS types by their short names, and which topic carries which.
#pragma once

#include "common/wire/rig.h"
#include "common/wire/topics.hpp"

namespace trocar::wire {

using Sample = trocar_wire_Sample;
using SampleBatch = trocar_wire_SampleBatch;
using Status = trocar_wire_Status;
using Event = trocar_wire_Event;
using Command = trocar_wire_Command;
using Reply = trocar_wire_Reply;

// Each type travels on exactly one topic, so the type alone names the topic and its quality of service.
template <class T>
struct TypeSupport;

#define TROCAR_WIRE_TYPE(TYPE, TOPIC)                                                                \
  template <>                                                                                        \
  struct TypeSupport<TYPE> {                                                                         \
    static constexpr const Topic& topic = TOPIC;                                                     \
    static const dds_topic_descriptor_t& descriptor() noexcept { return trocar_wire_##TYPE##_desc; } \
  }
TROCAR_WIRE_TYPE(SampleBatch, samples_topic);
TROCAR_WIRE_TYPE(Status, status_topic);
TROCAR_WIRE_TYPE(Event, events_topic);
TROCAR_WIRE_TYPE(Command, command_topic);
TROCAR_WIRE_TYPE(Reply, reply_topic);
#undef TROCAR_WIRE_TYPE

// In the order of `topics`.
[[nodiscard]] const dds_topic_descriptor_t& descriptor_of(const Topic& topic);

}  // namespace trocar::wire
