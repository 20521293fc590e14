// `trocar insert`: the run-time insertion model along a base path, offline.
#pragma once

#include <filesystem>
#include <string>

namespace trocar::cli {

struct InsertOptions {
  std::filesystem::path scene;         // .toml
  std::filesystem::path path;          // CSV t_s,x_m,y_m,theta_rad
  std::filesystem::path out;           // CSV, one row a path row
  std::filesystem::path contacts_out;  // CSV, one row a contact and path row; empty: none
  std::string method;                  // instead of the scene's; empty: the scene's
  bool json{};
};

// Exit code. Throws config::UserError; then no file was written.
// Between two path rows the base moves along a straight line in steps of at most 0.1 mm at base and tip, because cutting a path depends on
// the way; explicit contacts cut nothing, and one row is one step. solve_us of a row is the time of all its steps.
int run_insert(const InsertOptions& options);

}  // namespace trocar::cli
