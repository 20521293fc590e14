#include "harness.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

namespace trocar::testing {

namespace {

// TROCAR_PROGRAMS and TROCAR_SHARE come from CMakeLists.txt.
const std::filesystem::path programs = TROCAR_PROGRAMS;
const std::filesystem::path share = TROCAR_SHARE;

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "test set-up: %s\n", why.c_str());
  std::abort();
}

void rest() { std::this_thread::sleep_for(std::chrono::milliseconds(5)); }

}  // namespace

double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::string read_text(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void write_text(const std::filesystem::path& file, std::string_view text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  if (!out.flush()) give_up("cannot write " + file.string());
}

std::string shared_file(const std::string& name, const Edits& edits) {
  std::string text = read_text(share / name);
  for (const auto& [from, to] : edits) {
    const std::size_t at = text.find(from);
    if (at == std::string::npos) give_up(name + " has no \"" + from + "\"");
    text.replace(at, from.size(), to);
  }
  return text;
}

std::uint32_t own_domain() { return 100U + static_cast<std::uint32_t>(getpid()) % 101U; }

std::vector<std::uint16_t> free_udp_ports(std::size_t count) {
  std::vector<int> sockets;
  std::vector<std::uint16_t> ports;
  for (std::size_t i = 0; i < count; ++i) {
    sockets.push_back(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (bind(sockets.back(), reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        getsockname(sockets.back(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
      give_up("no free UDP port");
    ports.push_back(ntohs(address.sin_port));
  }
  for (const int s : sockets) close(s);
  return ports;
}

std::vector<pid_t> processes_mentioning(const std::string& text) {
  std::vector<pid_t> found;
  std::error_code error;
  for (std::filesystem::directory_iterator it("/proc", error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.find_first_not_of("0123456789") == std::string::npos && read_text(it->path() / "cmdline").find(text) != std::string::npos)
      found.push_back(static_cast<pid_t>(std::stol(name)));
  }
  return found;
}

Scratch::Scratch() {
  std::string name = (std::filesystem::temp_directory_path() / "trocar-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) give_up("cannot make " + name);
  folder_ = name;
}

Scratch::~Scratch() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::filesystem::path Scratch::make_rig(const Edits& edits, const std::string& name) const {
  const auto ports = free_udp_ports(4);
  const int first = name == "ubc_twin_haptic" ? 20010 : 20000;  // of the shipped file
  const auto other = [&](const char* key, int port, std::size_t by) {
    const std::string is = std::string(key) + " = ";
    return Edits::value_type{is + std::to_string(port), is + std::to_string(ports[by])};
  };
  Edits all{other("rig_port", first + 1, 0),
            other("plant_port", first, 1),
            other("rig_port", first + 3, 2),
            other("plant_port", first + 2, 3),
            // A shared machine may starve controller and plant for longer; what is tested here is not that.
            {"late_tick_best_effort_us = 50000", "late_tick_best_effort_us = 1000000"}};
  all.insert(all.end(), edits.begin(), edits.end());
  write_text(folder_ / "rig.toml", shared_file("rigs/" + name + ".toml", all));
  return folder_ / "rig.toml";
}

std::filesystem::path Scratch::make_experiment(const Edits& edits) const {
  Edits all{{"rig = \"ubc_twin\"", "rig = \"" + (folder_ / "rig.toml").string() + "\""},
            {"depth_m = 0.070", "depth_m = 0.010"},
            {"dwell_s = 0.5", "dwell_s = 0.1"},
            {"thesis_check = true", "thesis_check = false"}};
  all.insert(all.end(), edits.begin(), edits.end());
  write_text(folder_ / "experiment.toml", shared_file("experiments/insertion.toml", all));
  return folder_ / "experiment.toml";
}

Program::Program(const Scratch& scratch, const std::string& name, const std::vector<std::string>& arguments) {
  static int number = 0;
  const std::string stem = std::filesystem::path(name).filename().string();
  out_ = scratch / (stem + std::to_string(++number) + ".stdout");
  errors_ = scratch / (stem + std::to_string(number) + ".stderr");
  const std::string path = (programs / name).string();
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const auto& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, 2, errors_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addchdir_np(&actions, scratch.folder().c_str());
  const int error = posix_spawn(&pid_, path.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) give_up("cannot start " + path);
}

Program::~Program() {
  signal(SIGKILL);
  (void)wait(5.0);
}

bool Program::wait_for(std::string_view text, double timeout_s) {
  const double end = steady_s() + timeout_s;
  while (true) {
    const bool last = !running() || steady_s() > end;  // before the look: what it said at its end counts
    if (out().find(text) != std::string::npos || errors().find(text) != std::string::npos) return true;
    if (last) return false;
    rest();
  }
}

bool Program::running() {
  if (ended_) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
  ended_ = true;
  code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return false;
}

void Program::signal(int number) {
  if (running()) ::kill(pid_, number);
}

int Program::wait(double timeout_s) {
  const double end = steady_s() + timeout_s;
  while (running()) {
    if (steady_s() > end) {
      ::kill(pid_, SIGKILL);
      while (running()) rest();
      return code_ = -1;
    }
    rest();
  }
  return code_;
}

}  // namespace trocar::testing
