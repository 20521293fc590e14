#include "host/report/gnuplot.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "host/report/report.hpp"

namespace trocar::report {

void run_gnuplot(const std::string& script, const std::filesystem::path& folder) {
  const auto script_path = folder / "figures.gnuplot";
  const auto messages_path = folder / "messages.txt";
  {
    std::ofstream file(script_path, std::ios::binary);
    file << script;
    if (!file.flush()) throw ReportError("cannot write " + script_path.string() + ": free some space or choose another folder");
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, messages_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  // The path goes in as data; inside the script quotes double.
  std::string quoted = folder.string();
  for (std::size_t at = 0; (at = quoted.find('\'', at)) != std::string::npos; at += 2) quoted.insert(at, 1, '\'');
  std::string name = "gnuplot", option = "-e", set_folder = "folder='" + quoted + "'", file = script_path.string();
  char* arguments[] = {name.data(), option.data(), set_folder.data(), file.data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    throw ReportError("the figures need gnuplot, which is not installed: apt-get install --no-install-recommends gnuplot-nox");
  }
  if (error != 0) throw ReportError(std::string("gnuplot cannot be started: ") + std::strerror(error));
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  std::ifstream in(messages_path);
  const std::string messages{std::istreambuf_iterator<char>(in), {}};
  throw ReportError("gnuplot failed: " + messages + "(try: apt-get install --reinstall gnuplot-nox)");
}

}  // namespace trocar::report
