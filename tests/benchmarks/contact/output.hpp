// What the benchmark leaves: a table on the terminal, CSV files and two figures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace trocar::bench {

struct Timing {
  std::string scene{}, method{};
  std::size_t contacts{}, mesh_nodes{};
  double median_s{}, quartile1_s{}, quartile3_s{};
};

struct Error {
  std::string scene{}, method{};
  double worst_force_n{};       // of any contact, against the exact solution along the same course
  double worst_base_force_n{};  // of the sum
  double median_s{};
};

struct Ratio {
  enum class Goal : std::uint8_t { None, AtMost, AtLeast };
  std::string what{};
  double value{};
  Goal kind{};
  double goal{};
};

void print(const std::vector<Timing>& timings);
void print(const std::vector<Error>& errors);
void print(const std::vector<Ratio>& ratios);

// contact.csv, contact_error.csv, contact_error.svg (run time against error), contact_size.svg (cost against the size of the mesh). Throws
// std::runtime_error or report::ReportError when the folder cannot be written or gnuplot fails.
void write(const std::filesystem::path& folder, const std::vector<Timing>& timings, const std::vector<Error>& errors);

}  // namespace trocar::bench
