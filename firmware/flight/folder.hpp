// Flight recordings on disk: one file a fault, in the format of samples.csv, whole or not at all. A rig that faults again and again does
// not fill the disk: the oldest go.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>

#include "firmware/flight/recorder.hpp"

namespace trocar::flight {

inline constexpr std::size_t kept_files = 20;  // of about 1 MB each

class Folder {
 public:
  explicit Folder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Makes the folder when it is missing, writes flight_<UTC, to the ms>_<fault>.csv, then removes what is more than kept_files, and what
  // a program that was killed left half-written. Returns the file. Throws capture::CaptureError with path, reason and remedy.
  std::filesystem::path write(const Recording& recording, std::chrono::system_clock::time_point now) const;

 private:
  void tidy() const noexcept;

  std::filesystem::path folder_;
};

}  // namespace trocar::flight
