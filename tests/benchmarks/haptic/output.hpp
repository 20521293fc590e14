// Tables on the terminal, CSV files and three figures.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/benchmarks/haptic/feel.hpp"
#include "tests/benchmarks/haptic/z_width.hpp"

namespace trocar::bench {

void print(const std::vector<WallRow>& rows);
void print(const std::vector<FeltRow>& rows);
void print(const std::vector<FreeRow>& rows);

// haptic_wall.csv, haptic_felt.csv, haptic_free.csv, haptic_wall.svg, haptic_felt.svg, haptic_free.svg. Throws
// std::runtime_error or report::ReportError when the folder cannot be written or gnuplot fails.
void write(const std::filesystem::path& folder, const std::vector<WallRow>& walls, const std::vector<FeltRow>& felt,
           const std::vector<FreeRow>& free);

}  // namespace trocar::bench
