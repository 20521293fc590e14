#include "host/cli/process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "common/config/user_error.hpp"

namespace trocar::cli {

namespace {
double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Pointers into both; exec and spawn do not write there.
std::vector<char*> argv_of(const std::string& path, const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const auto& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  return argv;
}

config::UserError not_started(const std::string& path, int error) {
  return config::UserError(
      fmt::format("cannot start {} ({}): install the package of that name, or build it with ./run build", path, std::strerror(error)));
}

}  // namespace

std::filesystem::path program_folder() { return std::filesystem::read_symlink("/proc/self/exe").parent_path(); }

void become_program(const std::string& name, const std::vector<std::string>& arguments) {
  const std::string path = (program_folder() / name).string();
  std::vector<char*> argv = argv_of(path, arguments);
  ::execv(path.c_str(), argv.data());
  throw not_started(path, errno);
}

Process::Process(const std::string& name, const std::vector<std::string>& arguments) : name_(name) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw config::UserError(fmt::format("cannot start {}: {}", name, std::strerror(errno)));
  const std::string path = (program_folder() / name).string();
  std::vector<char*> argv = argv_of(path, arguments);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 2);
  // A group of its own: Ctrl-C reaches this program alone, which then ends its children in order.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  const int error = posix_spawn(&pid_, path.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  close(ends[1]);
  pipe_ = ends[0];
  if (error != 0) {
    close(pipe_);
    throw not_started(path, error);
  }
}

Process::~Process() {
  if (running()) {
    ::kill(pid_, SIGKILL);
    (void)wait(1.0);
  }
  close(pipe_);
}

std::string Process::read(double timeout_s) {
  pollfd poll_for{pipe_, POLLIN, 0};
  if (::poll(&poll_for, 1, static_cast<int>(1e3 * timeout_s)) <= 0) return {};
  std::array<char, 4096> buffer{};
  const ssize_t n = ::read(pipe_, buffer.data(), buffer.size());
  if (n <= 0) return {};
  const std::string text(buffer.data(), static_cast<std::size_t>(n));
  output_ += text;
  return text;
}

void Process::wait_for_line(const std::string& text, double timeout_s) {
  const double end = steady_s() + timeout_s;
  while (output_.find(text) == std::string::npos) {
    if (read(0.05).empty() && !running()) {
      while (!read(0.0).empty()) {
      }
      throw config::UserError(output_.empty() ? fmt::format("{} ended at once", name_)
                                              : output_.substr(0, output_.find_last_not_of('\n') + 1));
    }
    if (steady_s() > end) throw config::UserError(fmt::format("{} is not ready after {:g} s; it said: {}", name_, timeout_s, output_));
  }
}

bool Process::running() {
  if (ended_ || pid_ <= 0) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
  ended_ = true;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return false;
}

void Process::signal(int number) {
  if (running()) ::kill(pid_, number);
}

int Process::wait(double timeout_s) {
  const double end = steady_s() + timeout_s;
  while (running()) {
    (void)read(0.02);
    if (steady_s() > end) ::kill(pid_, SIGKILL);
  }
  while (!read(0.0).empty()) {
  }
  return exit_code_;
}

}  // namespace trocar::cli
