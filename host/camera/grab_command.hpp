// `trocar camera list` and `trocar camera grab`.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host/camera/source.hpp"

namespace trocar::camera {

// What cameras Aravis sees. Exit code 1 when there is none.
int run_list(bool json);

struct GrabOptions {
  std::vector<std::string> source{};
  SourceOptions source_options{};
  std::uint64_t frames{};       // 0: until stopped, or until the source ends
  std::filesystem::path out{};  // new folder: frame_NNNNNN.png by the camera's number, and frames.csv: number,t_s,arrival_s,file
};

// Frames into a folder, as they come: a Bayer frame keeps its pattern in one channel. t_s on the source's clock, arrival_s on the host's,
// both from the first frame. A recording: what was written stays when the camera is lost (exit code 1) or the disk is full. Ends with a
// line that states frames, losses, and the clocks' offset and drift with their uncertainty.
int run_grab(const GrabOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::camera
