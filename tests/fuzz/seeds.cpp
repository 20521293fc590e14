// Writes the inputs that cannot be typed: model images and captures of this version, into FOLDER/NAME of their targets.
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "common/capture/cdr.hpp"
#include "common/capture/mcap_writer.hpp"
#include "common/wire/convert.hpp"
#include "example.hpp"
#include "tiny_image.hpp"

using namespace trocar;

namespace {

void write_image(const std::filesystem::path& file, model::testing::TinyImage& tiny) {
  const model::testing::Bytes bytes = tiny.bytes();
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.span().data()), static_cast<std::streamsize>(bytes.span().size()));
}

std::string read(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// A capture of the rig but for its schemas, whose text is long and is never read.
void write_capture(const std::filesystem::path& file) {
  std::filesystem::remove(file);
  capture::McapWriter capture(file);
  const auto channel = [&](const wire::Topic& topic) {
    return capture.add_channel(capture.add_schema(topic.type, "omgidl", "mark"), topic.name, "cdr",
                               {{"protocol", std::to_string(protocol_version)}});
  };
  const std::uint16_t samples = channel(wire::samples_topic);
  const std::uint16_t events = channel(wire::events_topic);
  const std::uint16_t status = channel(wire::status_topic);
  for (std::uint64_t tick = 1; tick <= 2; ++tick)
    capture.write(samples, tick * 1000, tick * 1000, capture::serialise(wire::to_wire(example::sample(tick))));
  capture.write(events, 3000, 3000, capture::serialise(wire::to_wire(Event{.tick = 3, .kind = EventKind::Homed}, "homed")));
  wire::Status state{};
  wire::copy_text(state.machine, "a machine");
  capture.write(status, 4000, 4000, capture::serialise(state));
  capture.close();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder / "model_image");
  std::filesystem::create_directories(folder / "needle_tick");
  model::testing::TinyImage planar;
  write_image(folder / "model_image" / "explicit", planar);
  model::testing::TinyImage tiny;
  tiny.store_float32();
  tiny.law.explicit_count = 0;
  for (const auto method : {contact::Method::Embedded, contact::Method::Snap, contact::Method::Adapt}) {
    tiny.law.method = method;
    write_image(folder / "model_image" / ("method" + std::to_string(static_cast<int>(method))), tiny);
  }
  tiny.image.needle = {.length_m = 0.1,
                       .radius_m = 0.0007,
                       .elements = 8,
                       .bending_nm2 = 0.02,
                       .axial_n = 1e5,
                       .curvature_per_m = 0.5,
                       .face_rad = 0.3,
                       .tip_lateral = 0.1};
  write_image(folder / "needle_tick" / "bends", tiny);
  std::filesystem::create_directories(folder / "cdr");
  wire::BatchBuffer batch;
  for (std::uint64_t tick = 1; tick <= 2; ++tick) (void)batch.push(example::sample(tick));
  const auto write_cdr = [&](const char* name, char which, const std::vector<std::byte>& cdr) {
    write(folder / "cdr" / name, which + std::string(reinterpret_cast<const char*>(cdr.data()), cdr.size()));
  };
  write_cdr("batch", 0, capture::serialise(batch.message(0)));
  write_cdr("flight", 1, capture::serialise(batch.flight(2000)));
  write_cdr("status", 2, capture::serialise(wire::Status{}));
  write_cdr("event", 3, capture::serialise(wire::to_wire(Event{.tick = 3, .kind = EventKind::Homed}, "homed")));
  write_cdr("command", 4, capture::serialise(wire::to_wire(Command{.session = 7, .kind = CommandKind::Move}, "stiff", 1, 100)));
  std::array<float, 6> places{1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F};
  wire::Markers markers{};
  markers.rows = 2;
  markers.columns = 3;
  for (auto* sequence : {&markers.u_px, &markers.v_px, &markers.x_m}) {
    sequence->_buffer = places.data();
    sequence->_length = sequence->_maximum = static_cast<std::uint32_t>(places.size());
  }
  write_cdr("markers", 6, capture::serialise(markers));
  write_cdr("reply", 5, capture::serialise(wire::to_wire(Reply{.session = 7, .id = 1}, "done")));
  std::filesystem::create_directories(folder / "mcap");
  write_capture(folder / "mcap" / "whole");
  // Without a checksum over the messages, so that what is changed in them is looked at; and the same cut off.
  std::string bytes = read(folder / "mcap" / "whole");
  std::size_t chunk = capture::mcap::magic.size();
  while (bytes.at(chunk) != static_cast<char>(capture::Opcode::Chunk)) {
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + chunk + 1, sizeof length);
    chunk += capture::mcap::record_head + length;
  }
  for (std::size_t i = 0; i < 4; ++i) bytes[chunk + 1 + 8 + 24 + i] = 0;
  write(folder / "mcap" / "unchecked", bytes);
  write(folder / "mcap" / "cut_off", bytes.substr(0, bytes.size() * 2 / 3));
  return 0;
}
