#include "common/experiment/truth_file.hpp"

#include <fmt/format.h>

#include <string>

#include "common/config/csv.hpp"

namespace trocar::experiment {

namespace {
constexpr const char* header = "tick,time_ns,hand_fx_n,hand_fy_n,hand_tau_nm,x_m,y_m,theta_rad";
}

TruthFile::TruthFile(const std::filesystem::path& file) : file_(file) { file_.stream() << header << '\n'; }

void TruthFile::write(const Truth& t) {
  std::string row = fmt::format("{},{}", t.tick, t.time_ns);
  for (const auto* values : {&t.hand_wrench, &t.pose})
    for (const double value : *values) fmt::format_to(std::back_inserter(row), ",{:.17g}", value);
  file_.stream() << row << '\n';
}

std::vector<Truth> read_truth(const std::filesystem::path& file) {
  const config::Csv csv = config::Csv::load(file, {header});
  std::vector<Truth> all(csv.rows());
  for (std::size_t i = 0; i < csv.rows(); ++i) {
    if (csv(i, 0) < 0.0) csv.fail(i, "a tick below 0; the file is not what a simulation wrote");
    all[i].tick = static_cast<std::uint64_t>(csv(i, 0));
    all[i].time_ns = static_cast<std::int64_t>(csv(i, 1));
    for (std::size_t k = 0; k < 3; ++k) {
      all[i].hand_wrench[k] = csv(i, 2 + k);
      all[i].pose[k] = csv(i, 5 + k);
    }
  }
  return all;
}

}  // namespace trocar::experiment
