// Figure 5.13 of the thesis: a 20G needle of 0.15 m under tip forces up to 0.5 N, by the elastica (the yardstick), by our beam, and by the
// triangles of the thesis with their modulus as printed and fitted to the tube's compliance at small load.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/benchmarks/contact/output.hpp"
#include "tests/benchmarks/needle/output.hpp"

namespace trocar::bench {

// The tip under a force across it.
struct FigureRow {
  double load_n{};
  std::string method{};
  std::size_t elements{};  // along the needle; 0 for the elastica
  double x_m{}, y_m{};     // NaN without convergence
  double error_m{};        // distance to the elastica's tip
  std::string outcome{};
  int iterations{};
  double median_s{}, quartile1_s{}, quartile3_s{};
};

struct ThesisFigure {
  std::vector<FigureRow> rows{};
  std::vector<BendRow> bends{};  // run time against error, from fewer to more elements
  std::vector<Ratio> ratios{};
  bool error_met{};  // the goal that does not depend on time
};

[[nodiscard]] ThesisFigure thesis_figure(int turns);

void print(const ThesisFigure& figure);
// needle_thesis.csv. Throws std::runtime_error when the folder cannot be written.
void write(const std::filesystem::path& folder, const std::vector<FigureRow>& rows);

}  // namespace trocar::bench
