// A child process of ours whose output we keep: started beside the running program, told to stop, waited for.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace trocar::cli {

// The folder of the running program; the other programs are in it too.
[[nodiscard]] std::filesystem::path program_folder();

// This process goes on as another of our programs, with its stdin, stdout, stderr and exit code. Throws config::UserError when it is not
// there.
[[noreturn]] void become_program(const std::string& name, const std::vector<std::string>& arguments);

class Process {
 public:
  // Starts NAME from program_folder(). Its stdout and stderr come here. Throws config::UserError when it cannot start.
  Process(const std::string& name, const std::vector<std::string>& arguments);
  ~Process();  // kills what is still there
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Until the output has a line that contains `text`. When the process ends first or time is up: config::UserError with what it said.
  void wait_for_line(const std::string& text, double timeout_s);
  // What has arrived since the last call, at most waiting timeout_s for something.
  std::string read(double timeout_s);
  [[nodiscard]] bool running();
  void signal(int number);
  // Waits; after timeout_s kills it. Returns the exit code, or 128 + signal.
  int wait(double timeout_s);
  [[nodiscard]] const std::string& output() const noexcept { return output_; }
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

 private:
  std::string name_;
  pid_t pid_{-1};
  int pipe_{-1};
  int exit_code_{-1};
  bool ended_{};
  std::string output_;
};

}  // namespace trocar::cli
