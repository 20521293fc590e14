#include "tests/benchmarks/program/program.hpp"

#include <fmt/core.h>

#include <cstring>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace trocar::bench {

int run_program(const char* name, int count, char** argument, const std::function<int(const Options&)>& work) {
  try {
    Options options;
    options.out = std::filesystem::weakly_canonical(std::filesystem::path(argument[0])).parent_path().parent_path() / "bench";
    for (int k = 1; k < count; ++k) {
      if (std::strcmp(argument[k], "--quick") == 0) {
        options.quick = true;
      } else if (std::strcmp(argument[k], "--out") == 0 && k + 1 < count) {
        options.out = argument[++k];
      } else {
        fmt::print(stderr, "{}: unknown option \"{}\"; there are: --out FOLDER, --quick\n", name, argument[k]);
        return 2;
      }
    }
    std::error_code wrong;
    std::filesystem::create_directories(options.out, wrong);
    if (wrong) {
      fmt::print(stderr, "{}: cannot make the folder {} ({}); choose another with --out\n", name, options.out.string(), wrong.message());
      return 1;
    }
    return work(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", name, error.what());
    return 1;
  }
}

void step(const char* program, const std::string& what, const std::function<void()>& work) {
  fmt::print(stderr, "{}: {} …\n", program, what);
  work();
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  const std::filesystem::path part = path.string() + ".part";
  {
    std::ofstream file(part, std::ios::binary);
    file << text;
    if (!file.flush()) throw std::runtime_error("cannot write " + part.string() + ": free some space or choose another folder with --out");
  }
  std::filesystem::rename(part, path);
}

}  // namespace trocar::bench
