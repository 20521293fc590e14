// Writes example.mcap (closed) and example.csv with the same samples into the folder named by the argument.
#include <cstdio>
#include <exception>

#include "common/capture/rig_capture.hpp"
#include "common/capture/samples_csv.hpp"
#include "common/wire/convert.hpp"
#include "example.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    const std::filesystem::path folder = argv[1];
    const auto samples = example::samples(0, 2000);
    trocar::capture::RigCaptureWriter file(folder / "example.mcap");
    constexpr std::uint64_t start_ns = 1'700'000'000'000'000'000;
    for (std::size_t i = 0; i < samples.size(); i += 20) {
      const std::uint64_t now_ns = start_ns + i * 1'000'000;
      file.write_samples(std::span(samples).subspan(i, 20), start_ns);
      if (i % 500 == 0) {
        trocar::Event event;
        event.tick = i;
        event.value = 0.5;
        file.write(trocar::wire::to_wire(event, "event " + std::to_string(i)), now_ns);
        trocar::wire::Status status{};
        status.protocol = trocar::protocol_version;
        status.tick = i;
        trocar::wire::copy_text(status.rig, "ubc_twin");
        trocar::wire::copy_text(status.text, "ready");
        file.write(status, now_ns);
        file.write(trocar::wire::to_wire(trocar::Command{}, "thesis", 1, 2), now_ns);
        file.write(trocar::wire::to_wire(trocar::Reply{}, "no"), now_ns);
      }
    }
    file.close();
    trocar::capture::write_samples_csv(folder / "example.csv", samples);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
