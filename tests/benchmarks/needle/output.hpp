// What the benchmark leaves: tables on the terminal, CSV files and a figure of run time against error.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace trocar::bench {

// Tip of a cantilever under `load`, whatever that is in `scene`, by `method`.
struct BendRow {
  std::string scene{}, method{};
  std::size_t elements{};
  double load{};
  double error{};  // of the tip's position, over the length
  double order{};  // against the row with half the elements; 0 for none
  int iterations{};
  double median_s{}, quartile1_s{}, quartile3_s{};
};

struct StepRow {
  std::string what{};
  double median_s{}, quartile1_s{}, quartile3_s{};
};

// All or nothing: a temporary file, renamed. Throws std::runtime_error.
void write_file(const std::filesystem::path& path, const std::string& text);

void print(const std::vector<BendRow>& rows);
void print(const std::vector<StepRow>& rows, double floor_s);

// needle_bend.csv, needle_step.csv, needle_bend.svg, needle_thesis.svg. Throws std::runtime_error or report::ReportError when the folder
// cannot be written or gnuplot fails.
void write(const std::filesystem::path& folder, const std::vector<BendRow>& bends, const std::vector<StepRow>& steps);

}  // namespace trocar::bench
