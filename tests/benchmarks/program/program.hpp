// What the plain benchmark programs share: their options, their exit codes, and files that are whole or not there.
//   NAME_benchmark [--out FOLDER] [--quick]        FOLDER: build/PRESET/bench unless given
// Exit code: what the work returns; 1 with one line on an exception, 2 for wrong usage.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace trocar::bench {

struct Options {
  std::filesystem::path out{};
  bool quick{};
  [[nodiscard]] int turns(int full) const { return quick ? 3 : full; }
};

int run_program(const char* name, int count, char** argument, const std::function<int(const Options&)>& work);

// Says on stderr what is being worked on.
void step(const char* program, const std::string& what, const std::function<void()>& work);

// Written aside and renamed.
void write_file(const std::filesystem::path& path, const std::string& text);

}  // namespace trocar::bench
