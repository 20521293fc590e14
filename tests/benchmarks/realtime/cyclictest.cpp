#include "tests/benchmarks/realtime/cyclictest.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

#include "hal/realtime/setup.hpp"

namespace trocar::bench {
namespace {

constexpr int histogram_us = 20000;

std::int64_t number_after(const std::string& text, const std::string& label) {
  const std::size_t at = text.find(label);
  return at == std::string::npos ? 0 : std::stoll(text.substr(at + label.size()));
}

}  // namespace

Cyclictest::Cyclictest(int interval_us, int seconds, bool fifo, int core, std::filesystem::path file) : file_(std::move(file)) {
  std::vector<std::string> word{"cyclictest",
                                "--quiet",
                                "--threads=1",
                                "--mlockall",
                                fmt::format("--interval={}", interval_us),
                                fmt::format("--duration={}", seconds),
                                fmt::format("--histogram={}", histogram_us)};
  word.push_back(fifo ? fmt::format("--priority={}", hal::realtime::Request{}.priority) : std::string("--policy=other"));
  if (core >= 0) word.push_back(fmt::format("--affinity={}", core));
  std::vector<char*> argument;
  for (std::string& each : word) argument.push_back(each.data());
  argument.push_back(nullptr);
  // Not fork: the pages of a loop that is about to start shall stay writable. The thread that starts it may run under SCHED_FIFO;
  // cyclictest's own main thread shall not.
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawnattr_init(&attributes);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  const sched_param ordinary{};
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSCHEDULER);
  ::posix_spawnattr_setschedpolicy(&attributes, SCHED_OTHER);
  ::posix_spawnattr_setschedparam(&attributes, &ordinary);
  const int error = ::posix_spawnp(&child_, argument[0], &actions, &attributes, argument.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (error == 0) return;
  child_ = -1;
  absent_ = error == ENOENT ? "cyclictest is not installed (Debian package rt-tests)"
                            : fmt::format("cyclictest could not be started: {}", std::strerror(error));
}

Cyclictest::~Cyclictest() {
  if (child_ <= 0) return;
  ::kill(child_, SIGTERM);
  ::waitpid(child_, nullptr, 0);
}

CyclictestResult Cyclictest::result() {
  int status = 0;
  const pid_t child = std::exchange(child_, -1);
  if (child <= 0) return {.absent = absent_};
  if (::waitpid(child, &status, 0) != child) return {.absent = "cyclictest got lost"};
  std::ifstream stream(file_);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  stream.close();
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return {.absent = fmt::format("cyclictest failed: {}", text.substr(0, text.find('\n')))};
  CyclictestResult result = parse_cyclictest(text);
  if (result.count.empty()) result.absent = "cyclictest printed no histogram";
  return result;
}

CyclictestResult parse_cyclictest(const std::string& text) {
  CyclictestResult result;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::size_t us = 0;
    std::int64_t count = 0;
    if (!(words >> us >> count)) continue;
    if (result.count.size() <= us) result.count.resize(us + 1);
    result.count[us] = count;
  }
  result.beyond = number_after(text, "# Histogram Overflows:");
  result.most_us = static_cast<double>(number_after(text, "# Max Latencies:"));
  return result;
}

}  // namespace trocar::bench
