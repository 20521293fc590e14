// The figures of a run, drawn by gnuplot as SVG.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "host/report/report.hpp"

namespace trocar::report {

struct Figure {
  std::string file;  // name of the SVG
  std::string title;
  std::string caption;
};

// Draws into `folder`; figures without data are left out. `samples` without restarts.
[[nodiscard]] std::vector<Figure> draw_figures(const RunInfo& run, const Summary& summary, std::span<const Sample> samples,
                                               const std::filesystem::path& folder);

}  // namespace trocar::report
