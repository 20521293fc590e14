// `trocar demo` and `trocar experiment run`: an experiment with everything around it, from start to report.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace trocar::cli {

struct DemoOptions {
  std::string experiment = "insertion";
  std::vector<double> speeds_mm_s;  // empty: the experiment's own
  std::string hand;                 // empty: the experiment's own
  std::filesystem::path out;        // empty: runs/<time>
  bool lockstep{};                  // on the bench instead of processes
  bool camera{true};                // over the simulated phantom, where the plant has one
  bool own_rig{true};               // start plant and controller; false: they run already
  bool json{};
  std::int64_t domain = -1;  // DDS domain instead of the rig file's
  std::uint64_t seed = 1;
};

// Exit code. Progress goes to stderr, the result to stdout.
int run_demo(const DemoOptions& options, std::atomic<bool>& stop);

// Figures and report.html of a folder that a run left.
int make_report(const std::filesystem::path& folder, bool json);

}  // namespace trocar::cli
