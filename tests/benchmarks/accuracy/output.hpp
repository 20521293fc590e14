// What the accuracy benchmark leaves: tables on the terminal, CSV files, and the figure of run time against error.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/benchmarks/accuracy/course.hpp"
#include "tests/benchmarks/accuracy/solid.hpp"

namespace trocar::bench {

// Relative errors. Visible: root of the sum of squares over places at least two elements from the shaft, over that of the reference.
inline constexpr std::array<const char*, 7> metric_name{"axial_stiffness", "lateral_stiffness", "visible_axial", "visible_lateral",
                                                        "visible_slip",    "slip_force",        "slip_tip"};
using Metrics = std::array<double, metric_name.size()>;

struct ReferenceRow {
  std::string path{};
  double slipping{};  // share of the thresholds that is reached
  Metrics change{};   // between two refinements, the largest over all depths
};

struct ErrorRow {
  std::string path{}, element{};
  int side{};  // nodes per side
  std::string method{};
  Metrics error{};  // root mean square over all depths
  Answer answer{};  // at the last depth
  double tick_us{};
  std::size_t contacts{};
  insertion::Status status{};
};

struct CourseRow {
  std::string path{}, element{};
  int side{};
  std::string method{};
  Course course{};
};

// How many times smaller the first one's error is, in the geometric mean over meshes and paths.
struct Claim {
  std::string element{}, paths{}, metric{};
  double embedded_over_adapt{}, embedded_over_snap{}, adapt_over_snap{};
};

void print(const std::vector<ReferenceRow>& rows);
void print(const std::vector<ErrorRow>& rows);
void print(const std::vector<Claim>& claims);
// Against snap on oblique paths at the same element size.
void print_conforming(const std::vector<ErrorRow>& conforming, const std::vector<ErrorRow>& errors);
void print_convergence(const std::vector<ErrorRow>& rows, const std::vector<SolidAnswer>& solids);
double print(const std::vector<CourseRow>& rows);  // worst jump of the embedded method, mN

// accuracy_reference.csv, accuracy_error.csv, accuracy_continuity.csv, accuracy_solid.csv, accuracy.svg and accuracy.png. Throws
// std::runtime_error or report::ReportError when the folder cannot be written or gnuplot fails.
void write(const std::filesystem::path& folder, const std::vector<ReferenceRow>& references, const std::vector<ErrorRow>& errors,
           const std::vector<CourseRow>& courses, const std::vector<SolidAnswer>& solids);

}  // namespace trocar::bench
