// Made-up samples in which every field has a value of its own, and a folder that goes away.
#pragma once

#include <stdlib.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"

namespace example {

inline trocar::Sample sample(std::uint64_t tick) {
  trocar::Sample s;
  const auto t = static_cast<double>(tick);
  s.tick = tick;
  s.time_ns = static_cast<std::int64_t>(tick) * 1'000'000;
  s.mode = trocar::Mode::Position;
  s.fault = tick % 7 == 0 ? trocar::Fault::ForceLimit : trocar::Fault::None;
  s.moving = 1;
  s.gain_set = 2;
  s.command_id = 3;
  double next = t / 3.0;
  for (auto& v : s.position_counts) v = static_cast<std::int32_t>(-(next += 1.0));
  for (auto* a : {&s.joint_torque_command_nm, &s.joint_torque_measured_nm}) {
    for (auto& v : *a) v = std::sin(next += 1.0);
  }
  for (auto* a : {&s.pose, &s.velocity, &s.setpoint_pose, &s.setpoint_velocity, &s.wrench_command, &s.base_wrench}) {
    for (auto& v : *a) v = std::sin(next += 1.0);
  }
  s.residual_m = std::sin(next += 1.0);
  s.singularity = std::sin(next += 1.0);
  s.missed_feedback = static_cast<std::uint32_t>(tick % 5);
  s.wakeup_late_us = 0.1f * static_cast<float>(tick);
  s.tick_us = 12.3f;
  for (auto* a : {&s.handle_wrench, &s.virtual_pose, &s.virtual_wrench}) {
    for (auto& v : *a) v = std::sin(next += 1.0);
  }
  s.display_energy_j = std::sin(next += 1.0);
  s.virtual_contacts = static_cast<std::uint32_t>(tick % 40);
  s.virtual_status = static_cast<std::uint8_t>(tick % 3);
  return s;
}

inline std::vector<trocar::Sample> samples(std::uint64_t first, std::uint64_t count) {
  std::vector<trocar::Sample> all;
  for (std::uint64_t i = 0; i < count; ++i) all.push_back(sample(first + i));
  return all;
}

class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar_test_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const char* name) const { return path_ / name; }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

inline std::string slurp(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void spit(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
}

}  // namespace example
