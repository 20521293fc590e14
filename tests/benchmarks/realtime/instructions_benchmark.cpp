// How many instructions a tick takes: the course of realtime_benchmark in lock-step under callgrind, one cycle (in, about, out) at 1 kHz
// and at 4 kHz. Each tick is counted by itself, so the worst one is found, not guessed; nothing in it depends on the machine's load.
// Without arguments of valgrind it starts itself under valgrind; where that is not installed it says so and ends with 0.
// Exit code 1 when the course is not what it should be.
//   instructions_benchmark [--out FOLDER] [--quick]
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/image_file/mapped_image.hpp"
#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"
#include "tests/benchmarks/realtime/course.hpp"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#define TROCAR_CALLGRIND 1
#endif

namespace trocar::bench {
namespace {

constexpr const char* name = "instructions_benchmark";
constexpr double rates_hz[] = {1000.0, 4000.0};

struct Counted {
  double tick_hz{};
  int tick{};
  Counts counts{};
  std::int64_t instructions{};
};

#ifdef TROCAR_CALLGRIND

// Of a dump: "summary: COUNT" in its header.
std::int64_t instructions_of(const std::filesystem::path& dump) {
  std::ifstream file(dump);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("summary: ")) return std::stoll(line.substr(9));
  throw std::runtime_error(dump.string() + ": no summary in this dump of callgrind");
}

std::filesystem::path worst_dump(const std::filesystem::path& folder, double tick_hz) {
  return folder / fmt::format("worst.{:.0f}", tick_hz);
}

// Under callgrind: collecting is switched on for controller.tick alone, and every tick is a dump of its own. Of the dumps the one with most
// instructions stays.
int count_ticks(const Options& options) {
  const image_file::MappedImage image(options.out / "model.image");
  std::string table = "tick_hz,tick,contacts,newton,solves,pivots,instructions\n";
  int dumps = 0;
  bool sound = true;
  for (const double hz : rates_hz) {
    std::int64_t worst = 0;
    const auto course = std::make_unique<Course>(hz, image.image());
    const int ticks = static_cast<int>(hz * (options.quick ? 0.1 : cycle_s));
    for (int k = 0; k < ticks; ++k) {
      const controller::TickInput input = course->begin(0);
      CALLGRIND_TOGGLE_COLLECT;
      const hal::LinkCommand& command = course->controller().tick(input);
      CALLGRIND_TOGGLE_COLLECT;
      CALLGRIND_DUMP_STATS;
      const std::filesystem::path dump = options.out / fmt::format("dump.{}", ++dumps);
      const std::int64_t instructions = instructions_of(dump);
      if (instructions > worst)
        std::filesystem::rename(dump, worst_dump(options.out, hz));
      else
        std::filesystem::remove(dump);
      worst = std::max(worst, instructions);
      course->end(command);
      const Counts c = course->counts();
      sound = sound && course->haptic() && c.solved;
      table += fmt::format("{},{},{},{},{},{},{}\n", hz, k, c.contacts, c.newton, c.solves, c.pivots, instructions);
    }
  }
  write_file(options.out / "ticks.csv", table);
  return sound ? 0 : 1;
}

// Exit code; -1 when there is no such program.
int run_child(std::vector<std::string> word, const std::filesystem::path& output = {}) {
  std::vector<char*> argument;
  for (std::string& each : word) argument.push_back(each.data());
  argument.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  if (!output.empty()) ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  pid_t child{};
  int status{};
  const int error = ::posix_spawnp(&child, argument[0], &actions, nullptr, argument.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return -1;
  if (error != 0 || ::waitpid(child, &status, 0) != child) throw std::runtime_error(word[0] + " could not be run");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

std::vector<Counted> read_ticks(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  std::vector<Counted> all;
  while (std::getline(stream, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    Counted c;
    words >> c.tick_hz >> c.tick >> c.counts.contacts >> c.counts.newton >> c.counts.solves >> c.counts.pivots >> c.instructions;
    all.push_back(c);
  }
  return all;
}

// The lines of callgrind_annotate that name functions, "12,345 (12.3%)  file:function [object]", by their own instructions. Those that
// called the tick were entered before collecting began and are listed with all of it.
std::string top_functions(const std::filesystem::path& annotated, int most) {
  std::ifstream stream(annotated);
  std::string text;
  for (std::string line; most > 0 && std::getline(stream, line);) {
    if (line.find("%)") == std::string::npos || line.find("(100.0%)") != std::string::npos) continue;
    constexpr std::size_t width = 130;  // names of templates go on for lines
    text += "    " + line.substr(0, std::min(line.rfind(" ["), width)) + '\n';
    --most;
  }
  return text;
}

constexpr const char* figure = R"(
set datafile separator ','
set terminal svg size 1000,500 font 'sans,14' background 'white'
set grid
set key outside right top
set output folder.'/instructions.svg'
set title 'Instructions of each tick of one cycle, by callgrind'
set xlabel 'time [s]'
set ylabel 'instructions'
csv = folder.'/instructions.csv'
plot for [hz in '1000 4000'] csv skip 1 using ($1 == real(hz) ? $2 / $1 : NaN):7 with points pt 7 ps 0.3 title hz.' Hz'
)";

void report_rate(const std::vector<Counted>& all, double hz, const std::filesystem::path& folder, std::string& text) {
  std::vector<Counted> deep;
  int ticks = 0;
  for (const Counted& c : all)
    if (c.tick_hz == hz) {
      ++ticks;
      if (c.counts.contacts >= contacts_goal) deep.push_back(c);
    }
  text += fmt::format("{:.0f} Hz: {} ticks, {} with {} contacts or more\n", hz, ticks, deep.size(), contacts_goal);
  std::sort(deep.begin(), deep.end(), [](const Counted& a, const Counted& b) { return a.instructions < b.instructions; });
  if (!deep.empty()) {
    const auto at = [&](double part) {
      return deep[static_cast<std::size_t>(std::ceil(part * static_cast<double>(deep.size()))) - 1].instructions;
    };
    text += fmt::format("  of those: median {}, p99 {}, p99.99 {}, worst {} instructions\n", at(0.5), at(0.99), at(0.9999), at(1.0));
  }
  for (const Counted& c : all)
    if (c.tick_hz == hz &&
        std::none_of(all.begin(), all.end(), [&](const Counted& d) { return d.tick_hz == hz && d.instructions > c.instructions; })) {
      text +=
          fmt::format("  worst of all: tick {} with {} contacts, {} Newton iterations, {} solves, {} pivots: {} instructions, of them in\n",
                      c.tick, c.counts.contacts, c.counts.newton, c.counts.solves, c.counts.pivots, c.instructions);
      break;
    }
  const std::filesystem::path annotated = folder / "annotated.txt";
  if (run_child({"callgrind_annotate", "--threshold=100", worst_dump(folder, hz).string()}, annotated) == 0)
    text += top_functions(annotated, 12);
}

int run_under_valgrind(const Options& options) {
  const std::filesystem::path folder = options.out / "instructions_callgrind";
  std::filesystem::remove_all(folder);
  step(name, "compiling the model", [&] { compile_model(folder / "model.image"); });
  std::vector<std::string> command{"valgrind",
                                   "-q",
                                   "--tool=callgrind",
                                   "--collect-atstart=no",
                                   "--callgrind-out-file=" + (folder / "dump").string(),
                                   std::filesystem::canonical("/proc/self/exe").string(),
                                   "--out",
                                   folder.string()};
  if (options.quick) command.emplace_back("--quick");
  int code = 0;
  step(name, "counting instructions", [&] { code = run_child(command); });
  if (code == -1) {
    std::filesystem::remove_all(folder);
    fmt::print("{}: valgrind is not installed (Debian package valgrind): instructions of the ticks were not counted\n", name);
    return 0;
  }
  if (code != 0) return code;
  const std::vector<Counted> all = read_ticks(folder / "ticks.csv");
  std::string text = "Instructions of controller.tick, by callgrind, in lock-step; in-process drives\n";
  for (const double hz : rates_hz) report_rate(all, hz, folder, text);
  fmt::print("{}", text);
  std::filesystem::rename(folder / "ticks.csv", options.out / "instructions.csv");
  std::filesystem::remove_all(folder);
  report::run_gnuplot(figure, options.out);
  fmt::print("tables and figures: {}\n", options.out.string());
  return 0;
}

int run(const Options& options) { return RUNNING_ON_VALGRIND ? count_ticks(options) : run_under_valgrind(options); }

#else

int run(const Options&) {
  fmt::print("{}: built without <valgrind/callgrind.h> (Debian package valgrind): instructions of the ticks were not counted\n", name);
  return 0;
}

#endif

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program(trocar::bench::name, count, argument, trocar::bench::run); }
