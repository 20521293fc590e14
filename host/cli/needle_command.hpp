// `trocar needle bend`: the shape of a needle that bends under dead loads, base clamped at the origin along +x.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace trocar::cli {

struct NeedleBendOptions {
  std::filesystem::path needle{};  // .toml: only [needle], or a whole scene
  std::string tip_force{};         // "FX,FY", N; empty: none
  double tip_moment_nm{};
  std::vector<std::string> at{};  // "S,FX,FY": m from the base, N
  std::filesystem::path out{};    // CSV s_m,x_m,y_m,theta_rad, a row for each node and mid-node (thesis: column of nodes), base to tip
  bool json{};
};

// What is wrong with such an option's text, for the command line's parser; empty for `count` finite numbers between commas.
[[nodiscard]] std::string wrong_numbers(const std::string& text, std::size_t count, const char* pattern);

// Exit code. Throws config::UserError; then no file was written.
int needle_bend(const NeedleBendOptions& options);

}  // namespace trocar::cli
