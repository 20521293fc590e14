#include "host/check/load.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/config/user_error.hpp"

namespace trocar::check {

namespace {
constexpr std::size_t mebibyte = 1024 * 1024;
constexpr std::size_t memory_bytes = 64 * mebibyte;
constexpr std::size_t file_bytes = 32 * mebibyte;
constexpr std::size_t block_bytes = mebibyte;

std::size_t cores() {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof set, &set) == 0 ? static_cast<std::size_t>(std::max(1, CPU_COUNT(&set))) : 1;
}
}  // namespace

Load::Load(const std::filesystem::path& folder) : folder_(folder) {
  std::string name = (folder / "trocar-load-XXXXXX").string();
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0)
    throw config::UserError(fmt::format("{}: the load cannot write there ({}): set TMPDIR to a folder of a disk that you may write to",
                                        folder.string(), std::strerror(errno)));
  ::unlink(name.c_str());
  memory_.assign(cores(), std::vector<double>(memory_bytes / sizeof(double), 1.0));
  for (auto& memory : memory_) threads_.emplace_back([this, &memory] { chew(memory); });
  threads_.emplace_back([this] { write(); });
}

Load::~Load() {
  stop_ = true;
  for (std::thread& thread : threads_) thread.join();
  ::close(file_);
}

std::string Load::describe() const {
  return fmt::format("{} threads through {} MiB each, one that writes and syncs {} MiB in {}", threads_.size() - 1, memory_bytes / mebibyte,
                     file_bytes / mebibyte, folder_.string());
}

void Load::chew(std::vector<double>& memory) noexcept {
  constexpr std::size_t part = 65536;  // values until the next look at stop_
  while (!stop_.load(std::memory_order_relaxed)) {
    for (std::size_t at = 0; at < memory.size() && !stop_.load(std::memory_order_relaxed); at += part)
      for (std::size_t i = at; i < std::min(at + part, memory.size()); ++i) memory[i] = 0.5 * memory[i] + 1.0 / memory[i];
    ++sweeps_;
  }
}

void Load::write() noexcept {
  const std::vector<char> block(block_bytes, 'x');
  while (!stop_.load(std::memory_order_relaxed)) {
    for (std::size_t at = 0; at < file_bytes && !stop_.load(std::memory_order_relaxed); at += block_bytes) {
      const ssize_t written = ::pwrite(file_, block.data(), block.size(), static_cast<off_t>(at));
      if (written > 0) written_bytes_ += static_cast<std::uint64_t>(written);
      ::fdatasync(file_);
    }
  }
}

}  // namespace trocar::check
