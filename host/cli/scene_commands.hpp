// `trocar scene …`: check a scene, compile it into a model image, look at scenes and images.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>

namespace trocar::cli {

struct SceneCompileOptions {
  std::string scene{};              // name or path
  std::filesystem::path out{};      // the image
  std::filesystem::path visible{};  // the visible map; empty: the image's path with ".visible" behind it
  bool without_visible{};
  double memory_gb{16.0};
  bool json{};
};

// All throw config::UserError. compile: until it returns nothing stands at `out` or `visible` that was not there before.
int scene_check(const std::string& scene, bool json);
int scene_compile(const SceneCompileOptions& options, const std::atomic<bool>& stop);
// A file that ends in .toml, or the name of a scene, is compiled in memory; anything else is opened as an image.
int scene_info(const std::string& scene_or_image, bool json, const std::atomic<bool>& stop);

}  // namespace trocar::cli
