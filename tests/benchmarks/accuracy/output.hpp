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
inline constexpr int first_visible = 2;  // of three
using Metrics = std::array<double, metric_name.size()>;

struct ReferenceRow {
  std::string path{};
  double slipping{};  // share of the thresholds that is reached
  Metrics change{};   // of the extrapolation, from one refinement to the next; the largest over all depths
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

// Errors in the geometric mean over meshes and paths, and what the reference itself may be wrong by.
struct Claim {
  std::string element{}, paths{}, metric{};
  double embedded{}, adapt{}, snap{}, tolerance{};
};

void print(const std::vector<ReferenceRow>& rows);
void print(const std::vector<ErrorRow>& rows);
void print(const std::vector<Claim>& claims);
// Beside the errors of the path methods on the same oblique paths.
void print_alone(const std::vector<ErrorRow>& alone, const std::vector<ErrorRow>& errors);
void print_convergence(const std::vector<ErrorRow>& rows, const std::vector<SolidAnswer>& solids);
double print(const std::vector<CourseRow>& rows);  // worst jump of the embedded method, mN

// accuracy_reference.csv, accuracy_error.csv, accuracy_continuity.csv, accuracy_solid.csv, accuracy.svg and accuracy.png. Throws
// std::runtime_error or report::ReportError when the folder cannot be written or gnuplot fails.
void write(const std::filesystem::path& folder, const std::vector<ReferenceRow>& references, const std::vector<ErrorRow>& errors,
           const std::vector<CourseRow>& courses, const std::vector<SolidAnswer>& solids);

}  // namespace trocar::bench
