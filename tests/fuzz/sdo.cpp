// Service data objects: the client against a node that answers anything, a server against a client that asks anything, and the two against
// each other.
#include <array>
#include <optional>

#include "byte_source.hpp"
#include "hal/canopen/sdo.hpp"
#include "property.hpp"
#include "sim_plant/nodes/sdo_server.hpp"

using namespace trocar;
using namespace trocar::hal::canopen;
using fuzz::require;
using hal::CanFrame;
using State = SdoClient::State;

namespace {

constexpr std::uint8_t node = 3;
constexpr std::int64_t timeout_ns = 1'000'000;

void check_request(const CanFrame& frame) {
  require(frame.id == cob_sdo_request(node) && frame.length == 8 && !frame.extended && !frame.remote && !frame.error,
          "a client sends eight bytes to its node");
}

void check(const SdoClient& client, Object asked, bool upload) {
  require(client.data().size() <= SdoClient::capacity, "a value fits the capacity");
  if (client.state() == State::Done && upload && asked.bytes != 0)
    require(client.data().size() == asked.bytes, "an upload that is done has the object's length");
}

void check_decoded(const CanFrame& frame) {
  for (const SdoMessage& message : {decode_sdo_request(frame), decode_sdo_answer(frame)}) {
    require(message.kind <= SdoKind::Other && message.object.bytes <= 4, "a message of a known kind");
    const bool whole = frame.length == 8 && !frame.remote && !frame.error;
    require((message.kind != SdoKind::None) == whole, "decoded exactly when it is a whole data frame");
    if (message.object.bytes != 0 && message.object.bytes < 4)
      require(message.value >> (8u * message.object.bytes) == 0, "a value is not longer than stated");
    if (message.kind == SdoKind::Abort) require(to_string(static_cast<SdoAbort>(message.value)) != nullptr, "every code has a text");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteSource in(data, size);
  SdoClient client{node};
  sim_plant::SdoServer server{node};
  sim_plant::ObjectDictionary objects{{.node = node, .rated_torque_mnm = 1000, .peak_torque_permille = 3000}};
  std::int64_t now_ns = 0;
  Object asked{};
  bool upload = false;
  std::optional<CanFrame> wire;  // from the client to the server

  for (int step = 0; step < 24 && !in.empty(); ++step) {
    const auto action = in.take<std::uint8_t>();
    now_ns += (action >> 4) * 100'000;
    switch (action & 7) {
      case 0:  // a new transfer
      case 1: {
        asked = {in.take<std::uint16_t>(), in.take<std::uint8_t>(), static_cast<std::uint8_t>(in.take<std::uint8_t>() % 5)};
        upload = (action & 7) == 0;
        if (upload) {
          wire = client.upload(asked, now_ns);
        } else {
          std::array<std::uint8_t, SdoClient::capacity> value{};
          const std::size_t bytes = in.take<std::uint8_t>() % (value.size() + 1);
          in.fill(std::span(value).first(bytes));
          wire = client.download(asked, std::span(value).first(bytes), now_ns);
        }
        check_request(*wire);
        require(client.state() == State::Waiting, "a transfer that began waits");
        break;
      }
      case 2:
      case 3: {  // an answer from anywhere
        CanFrame frame = in.frame();
        if ((action & 7) == 2) {  // addressed, whole, and of the object that is asked for
          frame.id = cob_sdo_response(node);
          frame.length = 8;
          frame.extended = frame.remote = frame.error = false;
          if ((action & 8) != 0) {
            hal::store(frame, 1, asked.index);
            hal::store(frame, 3, asked.subindex);
          }
        }
        check_decoded(frame);
        const State before = client.state();
        const bool taken = client.receive(frame);
        require(taken || client.state() == before, "an answer that is not taken changes nothing");
        require(!taken || before == State::Waiting, "an answer is taken only by an open transfer");
        break;
      }
      case 4: {  // the server answers
        if (!wire) break;
        const auto outcome = server.receive(*wire, objects, now_ns);
        wire.reset();
        if (!outcome.answer) break;
        require(outcome.answer->id == cob_sdo_response(node) && outcome.answer->length == 8, "a server answers to its client");
        (void)client.receive(*outcome.answer);
        break;
      }
      case 5: {  // the server hears somebody else
        CanFrame frame = in.frame();
        frame.id = cob_sdo_request(node);
        check_decoded(frame);
        const auto outcome = server.receive(frame, objects, now_ns);
        if (outcome.answer) require(outcome.answer->id == cob_sdo_response(node) && outcome.answer->length == 8, "a server answers");
        if (outcome.written) require(outcome.answer.has_value(), "what was written is confirmed");
        break;
      }
      case 6:
        if (client.update(now_ns, timeout_ns) == State::TimedOut)
          require(client.abort_code() == static_cast<std::uint32_t>(SdoAbort::Timeout), "a time-out says so");
        (void)server.advance(now_ns);
        break;
      default:
        client.reset();
        require(client.state() == State::Idle, "reset leads to idle");
        break;
    }
    check(client, asked, upload);
    CanFrame next;
    if (client.next_frame(next, now_ns)) {
      check_request(next);
      wire = next;
      require(!client.next_frame(next, now_ns), "one frame at a time");
    }
  }
  return 0;
}
