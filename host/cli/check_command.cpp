#include "host/cli/check_command.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <system_error>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/rig/bus_budget.hpp"
#include "host/check/check.hpp"
#include "host/check/load.hpp"
#include "host/check/machine.hpp"
#include "host/cli/process.hpp"

namespace trocar::cli {

namespace {

namespace fs = std::filesystem;

constexpr double start_and_end_s = 30.0;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "trocar-check-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw config::UserError(
          fmt::format("{}: {}: set TMPDIR to a folder that you may write to", fs::temp_directory_path().string(), std::strerror(errno)));
    path = name;
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path path;
};

check::Figures measure(const RigCheckOptions& options, const fs::path& rig_file, const std::atomic<bool>& stop) {
  const Folder folder;
  const fs::path out = folder.path / "figures.toml";
  std::vector<std::string> arguments{"--rig", rig_file.string(), "--check",          fmt::format("{}", options.seconds),
                                     "--out", out.string(),      "--die-with-parent"};
  if (options.cpu >= 0) arguments.insert(arguments.end(), {"--cpu", std::to_string(options.cpu)});
  Process rig("trocar-rig", arguments);
  bool told = false;
  while (rig.running()) {
    (void)rig.read(0.1);
    if (!told && stop.load()) rig.signal(SIGINT);
    told = told || stop.load();
  }
  const int code = rig.wait(start_and_end_s);
  if (stop.load()) throw config::UserError("stopped before the check was over; nothing was judged");
  if (code != 0) throw config::UserError(fmt::format("trocar-rig --check ended with code {}: {}", code, rig.output()));
  return check::read_figures(out);
}

std::string text(std::string_view value) {
  std::string out = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

template <class List, class Function>
std::string array(const List& list, Function&& function) {
  std::string out = "[";
  for (const auto& item : list) out += (out.size() > 1 ? ", " : "") + function(item);
  return out + "]";
}

std::string json(const check::Latency& l) {
  return fmt::format("{{\"p50\": {}, \"p99\": {}, \"p99_99\": {}, \"max\": {}}}", l.p50, l.p99, l.p99_99, l.max);
}

std::string limit(std::uint64_t value) { return value == check::unlimited ? "null" : std::to_string(value); }

void print_json(const check::Figures& f, const check::Machine& m, const rig::BusBudget& bus, const check::Verdict& v,
                const std::string& load) {
  const auto number = [](int core) { return std::to_string(core); };
  const auto quoted = [](const std::string& s) { return text(s); };
  fmt::print("{{\"rig\": {}, \"fit_for_motors\": {}, \"against\": {}, \"advice\": {}, \"load\": {}, ", text(f.rig), v.fit(),
             array(v.against, quoted), array(v.advice, quoted), load.empty() ? "null" : text(load));
  fmt::print(
      "\"period_us\": {}, \"late_tick_us\": {}, \"ticks\": {}, \"moving_ticks\": {}, \"late_ticks\": {}, \"wakeup_late_us\": {}, "
      "\"tick_us\": {}, ",
      f.period_us, f.late_tick_us, f.ticks, f.moving, f.late, json(f.wakeup_late), json(f.tick));
  fmt::print(
      "\"overruns\": {}, \"minor_faults\": {}, \"major_faults\": {}, \"preemptions\": {}, \"allocations\": {}, \"armed_page_faults\": {}, "
      "\"armed_allocations\": {}, ",
      f.loop.overruns, f.loop.minor_faults, f.loop.major_faults, f.loop.preemptions, f.loop.allocations, f.loop.armed_page_faults,
      f.loop.armed_allocations);
  fmt::print("\"setup\": {}, ", array(f.setup, [](const check::SetupItem& s) {
               return fmt::format("{{\"name\": {}, \"asked\": {}, \"obtained\": {}, \"text\": {}}}", text(s.name), s.asked, s.obtained,
                                  text(s.text));
             }));
  fmt::print(
      "\"machine\": {{\"kernel\": {}, \"preempt_rt\": {}, \"clocksource\": {}, \"loop_core\": {}, \"cores\": {}, \"isolated\": {}, "
      "\"nohz_full\": "
      "{}, \"smt\": {}, \"governors\": {}, \"memlock_bytes\": {}, \"rtprio\": {}}}, ",
      text(m.kernel), m.preempt_rt, text(m.clocksource), f.cpu < 0 ? "null" : std::to_string(f.cpu), array(m.online, number),
      array(m.isolated, number), array(m.nohz_full, number), m.smt ? (*m.smt ? "true" : "false") : "null", array(m.governors, quoted),
      limit(m.memlock_bytes), limit(m.rtprio));
  fmt::print(
      "\"bus\": {{\"drives_percent\": {:.1f}, \"drives_peak_percent\": {:.1f}, \"drives_heartbeat_percent\": {:.1f}, \"sensor_percent\": "
      "{:.1f}, "
      "\"fits\": {}}}}}\n",
      bus.drives_cyclic_percent, bus.drives_peak_percent, bus.heartbeat_percent, bus.sensor_percent, bus.fits());
}

void print_text(const check::Figures& f, const check::Machine& m, const rig::BusBudget& bus, const check::Verdict& v,
                const std::string& load) {
  fmt::print("{}: {} ticks of {:g} us on {}, {}\n\n", f.rig, f.ticks, f.period_us, f.cpu < 0 ? "any core" : fmt::format("core {}", f.cpu),
             load.empty() ? "without load" : "under load: " + load);
  fmt::print("                          p50       p99    p99.99       max\n");
  const auto row = [](const char* name, const check::Latency& l, const std::string& rest) {
    fmt::print("{:<19}{:10.1f}{:10.1f}{:10.1f}{:10.1f} us   {}\n", name, l.p50, l.p99, l.p99_99, l.max, rest);
  };
  row("wake-up, late by", f.wakeup_late, fmt::format("limit {:g}; later than that: {} ticks", f.late_tick_us, f.late));
  row("tick, execution", f.tick, fmt::format("after at most {:g} of waiting for the drives", f.feedback_deadline_us));
  fmt::print("overruns {} (ticks that ended after the next one was due); preemptions {}\n", f.loop.overruns, f.loop.preemptions);
  fmt::print("page faults: {} minor, {} major, {} while armed; allocations: {}, {} while armed\n\n", f.loop.minor_faults,
             f.loop.major_faults, f.loop.armed_page_faults, f.loop.allocations, f.loop.armed_allocations);

  fmt::print("real-time set-up of the loop:\n");
  for (const check::SetupItem& item : f.setup) fmt::print("  {} {}\n", item.obtained ? "+" : item.asked ? "-" : " ", item.text);
  std::string governors;
  for (const std::string& g : m.governors) governors += (governors.empty() ? "" : ", ") + g;
  fmt::print("machine:\n  kernel {} ({}), clock {}\n  cores {}, isolated {}, nohz_full {}, hyper-threads {}, governor {}\n", m.kernel,
             m.preempt_rt ? "PREEMPT_RT" : "not PREEMPT_RT", m.clocksource.empty() ? "unknown" : m.clocksource, check::to_text(m.online),
             check::to_text(m.isolated), check::to_text(m.nohz_full), m.smt ? (*m.smt ? "on" : "off") : "unknown",
             governors.empty() ? "none to choose" : governors);
  fmt::print("  limits of this user: locked memory {}, real-time priority {}\n",
             m.memlock_bytes == check::unlimited ? "unlimited" : fmt::format("{} KiB", m.memlock_bytes / 1024),
             m.rtprio == check::unlimited ? "unlimited" : std::to_string(m.rtprio));
  fmt::print("bus load, worst-case bit stuffing:\n  drives {:.0f} % (peak {:.0f} %, and heartbeats {:.1f} %), sensor {:.0f} %{}\n",
             bus.drives_cyclic_percent, bus.drives_peak_percent, bus.heartbeat_percent, bus.sensor_percent,
             bus.fits() ? "" : ": DOES NOT FIT");
  if (!v.advice.empty()) fmt::print("\nadvice:\n");
  for (const std::string& line : v.advice) fmt::print("  {}\n", line);
  fmt::print("\n{}\n", v.fit() ? "fit for motors" : "only for simulation, because:");
  for (const std::string& line : v.against) fmt::print("  {}\n", line);
}

}  // namespace

int rig_check(const RigCheckOptions& options, const std::atomic<bool>& stop) {
  const fs::path file = config::find_share("rigs", options.rig);
  const rig::Rig rig = config::read_twin(file);
  const check::Machine machine = check::look_at_machine();
  std::optional<check::Load> load;
  if (options.load) load.emplace(fs::temp_directory_path());
  const std::string load_text = load ? load->describe() : "";
  fmt::print(stderr, "measuring for {:g} s{} …\n", options.seconds, load ? " under load" : "");
  const check::Figures figures = measure(options, file, stop);
  load.reset();
  const rig::BusBudget budget = rig::bus_budget(rig);
  const check::Verdict verdict = check::judge(figures, machine, budget, options.load);
  options.json ? print_json(figures, machine, budget, verdict, load_text) : print_text(figures, machine, budget, verdict, load_text);
  return verdict.fit() ? 0 : 1;
}

}  // namespace trocar::cli
