// Keeps the machine busy while something else is measured: on every core a thread of ordinary priority that computes its way through
// memory, larger than a cache holds, and one thread that writes a file and has the disk take it.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

namespace trocar::check {

class Load {
 public:
  // Begins. The file lies in `folder` and has no name: it is gone with this process, however that ends. Throws config::UserError when it
  // cannot be made.
  explicit Load(const std::filesystem::path& folder);
  ~Load();
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;

  [[nodiscard]] std::string describe() const;                              // one line
  [[nodiscard]] std::uint64_t sweeps() const noexcept { return sweeps_; }  // through a thread's memory, all threads together
  [[nodiscard]] std::uint64_t written_bytes() const noexcept { return written_bytes_; }

 private:
  void chew(std::vector<double>& memory) noexcept;
  void write() noexcept;

  std::filesystem::path folder_;
  int file_{-1};
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> sweeps_{0}, written_bytes_{0};
  std::vector<std::vector<double>> memory_;
  std::vector<std::thread> threads_;
};

}  // namespace trocar::check
