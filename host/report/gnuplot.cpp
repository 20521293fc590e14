#include "host/report/gnuplot.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>

#include "host/report/report.hpp"
#include "host/tool/run.hpp"

namespace trocar::report {

void run_gnuplot(const std::string& script, const std::filesystem::path& folder) {
  const auto script_path = folder / "figures.gnuplot";
  const auto messages_path = folder / "messages.txt";
  {
    std::ofstream file(script_path, std::ios::binary);
    file << script;
    if (!file.flush()) throw ReportError("cannot write " + script_path.string() + ": free some space or choose another folder");
  }
  // The path goes in as data; inside the script quotes double.
  std::string quoted = folder.string();
  for (std::size_t at = 0; (at = quoted.find('\'', at)) != std::string::npos; at += 2) quoted.insert(at, 1, '\'');
  const tool::Outcome outcome = tool::run({"gnuplot", "-e", "folder='" + quoted + "'", script_path.string()}, messages_path);
  if (outcome.error_number == ENOENT) {
    throw ReportError("the figures need gnuplot, which is not installed: apt-get install --no-install-recommends gnuplot-nox");
  }
  if (outcome.error_number != 0) throw ReportError(std::string("gnuplot cannot be started: ") + std::strerror(outcome.error_number));
  if (!outcome.good) throw ReportError("gnuplot failed: " + outcome.messages + "(try: apt-get install --reinstall gnuplot-nox)");
}

}  // namespace trocar::report
