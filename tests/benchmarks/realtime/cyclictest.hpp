// cyclictest (Debian's rt-tests) as a child process: what wake-ups on this machine are late by while ours are measured.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace trocar::bench {

struct CyclictestResult {
  std::string absent{};               // why there is none
  std::vector<std::int64_t> count{};  // of wake-ups, by lateness in whole us
  std::int64_t beyond{};              // later than the histogram has
  double most_us{};
};

class Cyclictest {
 public:
  // Starts it with this interval on this core (-1: any), under SCHED_FIFO with the priority of our own thread or under the ordinary
  // scheduler. Its output goes to `file`. Throws nothing: result() says why it did not run.
  Cyclictest(int interval_us, int seconds, bool fifo, int core, std::filesystem::path file);
  Cyclictest(const Cyclictest&) = delete;
  Cyclictest& operator=(const Cyclictest&) = delete;
  ~Cyclictest();

  // Waits for its end.
  [[nodiscard]] CyclictestResult result();

 private:
  std::filesystem::path file_;
  pid_t child_{-1};
  std::string absent_{};
};

// Lines "us count" up to the first comment after them, and "# Max Latencies", "# Histogram Overflows".
[[nodiscard]] CyclictestResult parse_cyclictest(const std::string& text);

}  // namespace trocar::bench
