// How many instructions a tick takes: the course of realtime_benchmark in lock-step under callgrind, one cycle (in, about, out) at 1 kHz
// and at 4 kHz. Each tick is counted by itself, so the worst one is found, not guessed; nothing in it depends on the machine's load.
// It starts itself under valgrind, once for each rate; where that is not installed it says so and ends with 0. Takes 2 to 4 minutes.
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
#include <iterator>
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

// Under callgrind, in a folder that is named after the rate: collecting is switched on for controller.tick alone, and every tick is a dump
// of its own. Of the dumps the one with most instructions stays.
int count_ticks(const Options& options) {
  const double hz = std::stod(options.out.filename().string());
  const image_file::MappedImage image(options.out.parent_path() / "model.image");
  const auto course = std::make_unique<Course>(hz, image.image());
  const int ticks = static_cast<int>(hz * (options.quick ? 0.1 : cycle_s));
  std::string table;
  std::int64_t worst = 0;
  bool sound = true;
  CALLGRIND_START_INSTRUMENTATION;
  for (int k = 0; k < ticks; ++k) {
    const controller::TickInput input = course->begin(0);
    CALLGRIND_TOGGLE_COLLECT;
    const hal::LinkCommand& command = course->controller().tick(input);
    CALLGRIND_TOGGLE_COLLECT;
    CALLGRIND_DUMP_STATS;
    const std::filesystem::path dump = options.out / fmt::format("dump.{}", k + 1);
    const std::int64_t instructions = instructions_of(dump);
    if (instructions > worst)
      std::filesystem::rename(dump, options.out / "worst");
    else
      std::filesystem::remove(dump);
    worst = std::max(worst, instructions);
    course->end(command);
    const Counts c = course->counts();
    sound = sound && course->haptic() && c.solved;
    table += fmt::format("{},{},{},{},{},{},{}\n", hz, k, c.contacts, c.newton, c.solves, c.pivots, instructions);
  }
  write_file(options.out / "ticks.csv", table);
  return sound ? 0 : 1;
}

// 0 when there is no such program.
pid_t start(std::vector<std::string> word, const std::filesystem::path& output = {}) {
  std::vector<char*> argument;
  for (std::string& each : word) argument.push_back(each.data());
  argument.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  if (!output.empty()) ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  pid_t child{};
  const int error = ::posix_spawnp(&child, argument[0], &actions, nullptr, argument.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return 0;
  if (error != 0) throw std::runtime_error(word[0] + " could not be run");
  return child;
}

int exit_code(pid_t child) {
  int status{};
  return ::waitpid(child, &status, 0) == child && WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

std::vector<Counted> read_ticks(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::vector<Counted> all;
  for (std::string line; std::getline(stream, line);) {
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

std::string describe(const std::vector<Counted>& all, const std::filesystem::path& folder) {
  std::vector<Counted> deep;
  for (const Counted& c : all)
    if (c.counts.contacts >= contacts_goal) deep.push_back(c);
  std::string text =
      fmt::format("{:.0f} Hz: {} ticks, {} with {} contacts or more\n", all.front().tick_hz, all.size(), deep.size(), contacts_goal);
  const auto less = [](const Counted& a, const Counted& b) { return a.instructions < b.instructions; };
  std::sort(deep.begin(), deep.end(), less);
  const auto at = [&](double part) {
    return deep[static_cast<std::size_t>(std::ceil(part * static_cast<double>(deep.size()))) - 1].instructions;
  };
  if (!deep.empty())
    text += fmt::format("  of those: median {}, p99 {}, p99.99 {}, worst {} instructions\n", at(0.5), at(0.99), at(0.9999), at(1.0));
  const Counted& worst = *std::max_element(all.begin(), all.end(), less);
  text += fmt::format("  worst of all: tick {} with {} contacts, {} Newton iterations, {} solves, {} pivots: {} instructions, of them in\n",
                      worst.tick, worst.counts.contacts, worst.counts.newton, worst.counts.solves, worst.counts.pivots, worst.instructions);
  const std::filesystem::path annotated = folder / "annotated.txt";
  const pid_t child = start({"callgrind_annotate", "--threshold=100", (folder / "worst").string()}, annotated);
  return child > 0 && exit_code(child) == 0 ? text + top_functions(annotated, 12) : text;
}

int run_under_valgrind(const Options& options) {
  const std::filesystem::path folder = options.out / "instructions_callgrind";
  std::filesystem::remove_all(folder);
  step(name, "compiling the model", [&] { compile_model(folder / "model.image"); });
  std::vector<pid_t> children;
  std::vector<std::filesystem::path> rates;
  for (const char* hz : {"1000", "4000"}) {
    rates.push_back(folder / hz);
    std::filesystem::create_directories(rates.back());
    std::vector<std::string> command{"valgrind",
                                     "-q",
                                     "--tool=callgrind",
                                     "--instr-atstart=no",  // the way to Haptic is long
                                     "--collect-atstart=no",
                                     "--callgrind-out-file=" + (rates.back() / "dump").string(),
                                     std::filesystem::canonical("/proc/self/exe").string(),
                                     "--out",
                                     rates.back().string()};
    if (options.quick) command.emplace_back("--quick");
    children.push_back(start(command));
  }
  if (children.front() == 0) {
    std::filesystem::remove_all(folder);
    fmt::print("{}: valgrind is not installed (Debian package valgrind): instructions of the ticks were not counted\n", name);
    return 0;
  }
  bool sound = true;
  step(name, "counting instructions", [&] {
    for (const pid_t child : children) sound = exit_code(child) == 0 && sound;
  });
  if (!sound) {
    std::filesystem::remove_all(folder);
    throw std::runtime_error(
        "counting under valgrind failed, or the course was not what it should be (left Haptic, or a step without solution)");
  }
  std::string table = "tick_hz,tick,contacts,newton,solves,pivots,instructions\n";
  std::string text = "Instructions of controller.tick, by callgrind, in lock-step, each tick of one cycle; in-process drives\n";
  for (const std::filesystem::path& rate : rates) {
    std::ifstream stream(rate / "ticks.csv");
    table.append(std::istreambuf_iterator<char>(stream), {});
    text += describe(read_ticks(rate / "ticks.csv"), rate);
  }
  fmt::print("{}", text);
  write_file(options.out / "instructions.csv", table);
  write_file(options.out / "instructions.txt", text);
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
