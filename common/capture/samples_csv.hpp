// samples.csv: one row a tick, a header line with units in the names, numbers that read back to the same value (%.17g; %.9g for the two
// single-precision columns). Equal samples give equal bytes. Missing ticks stay missing and are counted.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "common/capture/rig_capture.hpp"
#include "common/core/contracts.hpp"

namespace trocar::capture {

// The header line, without line end.
[[nodiscard]] std::string_view samples_csv_header();
// Appends one row with its line end.
void append_samples_csv(std::string& out, const trocar::Sample& sample);

// Writes to a temporary file beside `path`; finish() gives it its name. Without finish() nothing stays behind.
class SamplesCsv {
 public:
  explicit SamplesCsv(std::filesystem::path path);
  ~SamplesCsv();
  SamplesCsv(const SamplesCsv&) = delete;
  SamplesCsv& operator=(const SamplesCsv&) = delete;

  void write(const trocar::Sample& sample);
  void finish();
  [[nodiscard]] const TickCounter& ticks() const noexcept { return ticks_; }

 private:
  void put();
  [[noreturn]] void fail(int error);

  std::filesystem::path path_, temporary_;
  std::FILE* file_{};
  std::string buffer_;
  TickCounter ticks_;
};

// All of them at once; returns what is missing.
TickCounter write_samples_csv(const std::filesystem::path& path, std::span<const trocar::Sample> samples);

}  // namespace trocar::capture
