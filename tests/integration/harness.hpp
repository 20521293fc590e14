// What the process tests share: a folder that vanishes, programs started as a person would, a rig of one's own on free ports.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace trocar::testing {

using Edits = std::vector<std::pair<std::string, std::string>>;  // text to find, text to put in its place

[[nodiscard]] double steady_s();
[[nodiscard]] std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, std::string_view text);
// A file of host/share (such as "rigs/ubc_twin.toml") with its edits made. A text that is not there ends the test program: an edit
// that does nothing would make a test that cannot fail.
[[nodiscard]] std::string shared_file(const std::string& name, const Edits& edits = {});
// DDS domain of this test process, 100 … 200, so that tests and rigs side by side do not hear each other.
[[nodiscard]] std::uint32_t own_domain();
// UDP ports of the loopback that nobody had a moment ago.
[[nodiscard]] std::vector<std::uint16_t> free_udp_ports(std::size_t count);
// Ids of processes that have `text` in their command line.
[[nodiscard]] std::vector<pid_t> processes_mentioning(const std::string& text);

class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

  // ubc_twin on four free ports, in the file rig.toml of this folder.
  std::filesystem::path make_rig(const Edits& edits = {}, const std::string& name = "ubc_twin") const;
  // The insertion experiment with this folder's rig.toml and a short stroke, in experiment.toml.
  std::filesystem::path make_experiment(const Edits& edits = {}) const;

 private:
  std::filesystem::path folder_;
};

// One of the programs in build/…/bin, in the scratch folder, with its output in files there. Killed, not asked, when it goes out of scope.
class Program {
 public:
  Program(const Scratch& scratch, const std::string& name, const std::vector<std::string>& arguments);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  [[nodiscard]] bool wait_for(std::string_view text, double timeout_s);  // in stdout or stderr
  [[nodiscard]] bool running();
  void signal(int number);
  // Exit code, 128 + signal, or -1 when it still ran after timeout_s (it is killed then).
  int wait(double timeout_s);
  [[nodiscard]] std::string out() const { return read_text(out_); }
  [[nodiscard]] std::string errors() const { return read_text(errors_); }
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

 private:
  std::filesystem::path out_, errors_;
  pid_t pid_{-1};
  bool ended_{};
  int code_{-1};
};

}  // namespace trocar::testing
