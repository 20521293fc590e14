// Runs gnuplot on a script.
#pragma once

#include <filesystem>
#include <string>

namespace trocar::report {

// Runs `script` with `folder` as the place for its outputs (the script's variable `folder`). Throws ReportError when gnuplot is not
// installed, or with what it printed when it failed.
void run_gnuplot(const std::string& script, const std::filesystem::path& folder);

}  // namespace trocar::report
