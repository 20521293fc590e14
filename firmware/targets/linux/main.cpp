// trocar-rig: the controller process on the rig controller PC. Start-up may allocate and fail; then the loop below runs the tick
// once a period until it is told to stop.
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/utsname.h>
#include <CLI/CLI.hpp>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "common/config/new_file.hpp"
#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/wire/dds.hpp"
#include "firmware/bridge/bridge.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/model_watch/model_watch.hpp"
#include "firmware/targets/linux/check.hpp"
#include "firmware/targets/linux/loop.hpp"
#include "firmware/targets/linux/loop_watch.hpp"
#include "hal/can/endpoint_bus.hpp"
#include "hal/realtime/clock.hpp"
#include "hal/realtime/setup.hpp"
#include "hal/rig_link.hpp"

namespace {

using namespace trocar;
namespace rt = hal::realtime;

std::atomic<bool> stop_asked{false};

void on_signal(int) { stop_asked.store(true); }

struct Options {
  std::string rig = "ubc_twin";
  bool best_effort{};
  int cpu = -1;
  int priority = 80;
  std::int64_t domain = -1;
  std::string model;
  std::string flight = "flight";
  bool open_network{};
  double check_s{};
  std::string out;
};

// Everything of fixed size that the loop uses, in one block that the memory lock covers.
struct Process {
  explicit Process(const rig::Rig& r) : rig(r) {}
  rig::Rig rig;
  controller::Mailboxes mail;
  bridge::Shared shared;
  hal::EndpointBus drives, sensor;
};

void run_rig(Process& p, controller::Controller& controller, LoopWatch& watch) {
  hal::RigLink<hal::EndpointBus> link(p.rig, p.drives, p.sensor);
  const std::array<int, 2> inputs{p.drives.file_descriptor(), p.sensor.file_descriptor()};
  int until_shutdown = -1;  // ticks left after a stop was asked, so that braking and disabling get their time
  run_loop(p.rig, link, inputs, controller, watch, [&](std::uint64_t tick, const LoopCounters& loop) {
    p.mail.samples.push(controller.sample());
    if (tick % ticks_per_tally == 0)
      p.shared.snapshots.push(
          {controller.status(), link.report(), link.feedback().state == hal::LinkState::Operational, link.bus_report(), loop});
    if (until_shutdown > 0) --until_shutdown;
    if (until_shutdown < 0 && stop_asked.load(std::memory_order_relaxed)) {
      controller.stop();
      until_shutdown = static_cast<int>(0.5 * p.rig.timing.tick_hz);
    }
    if (until_shutdown > 1 && !safety::has_torque(controller.status().mode)) until_shutdown = 1;
    return until_shutdown != 0;
  });
  link.shut_down(rt::monotonic_now_ns());
}

// Asks for the set-up and says on stderr what was refused. Returns the same as one line.
std::string set_up(rt::Setup& setup, const Options& options) {
  setup.apply({options.priority, options.cpu});
  std::string missing;
  for (std::size_t i = 0; i < rt::item_count; ++i) {
    const auto item = static_cast<rt::Item>(i);
    const rt::Outcome& outcome = setup.outcome(item);
    if (!outcome.asked || outcome.obtained) continue;
    std::array<char, 256> line{};
    rt::describe(item, outcome, line);
    fmt::print(stderr, "trocar-rig: {}\n", line.data());
    missing += missing.empty() ? line.data() : fmt::format("; {}", line.data());
  }
  return missing;
}

// Root on a stock kernel is granted the rest and still wakes up some ms late: without PREEMPT_RT the best-effort limit judges.
bool is_real_time(const rt::Setup& setup) { return setup.complete() && setup.outcome(rt::Item::Kernel).obtained; }

std::string machine(const rt::Setup& setup, const Options& options, const std::string& missing) {
  utsname name{};
  uname(&name);
  return fmt::format("{} {}, {}, {}, {}; {}", name.sysname, name.release,
                     setup.outcome(rt::Item::Kernel).obtained ? "PREEMPT_RT" : "not PREEMPT_RT",
                     setup.outcome(rt::Item::Affinity).obtained ? fmt::format("core {}", options.cpu) : "any core",
                     setup.outcome(rt::Item::Scheduler).obtained ? fmt::format("SCHED_FIFO {}", options.priority) : "ordinary scheduling",
                     missing.empty() ? "real-time set-up complete" : missing);
}

int check(const Options& options) {
  const rig::Rig rig = config::read_twin(config::find_share("rigs", options.rig));
  std::optional<config::NewFile> out;
  if (!options.out.empty()) out.emplace(options.out);
  CheckFigures figures;
  reserve(rig, options.check_s, figures);
  if (options.cpu >= 0) rt::leave_core(options.cpu);
  LoopWatch watch(stall_limit_ns(rig, false));
  rt::Setup setup;
  set_up(setup, options);
  run_check(rig, options.check_s, is_real_time(setup), watch, stop_asked, figures);
  const std::string text = to_toml(rig, setup, options.cpu, is_real_time(setup), std::move(figures));
  if (out) {
    out->stream() << text;
    out->keep();
  } else {
    fmt::print("{}", text);
  }
  return 0;
}

int run(const Options& options) {
  const auto path = config::find_share("rigs", options.rig);
  auto process = std::make_unique<Process>(config::read_twin(path));
  Process& p = *process;
  if (options.domain >= 0) p.rig.dds_domain = static_cast<std::uint32_t>(options.domain);
  if (!options.model.empty()) {
    const control::Admissible verdict = p.rig.haptic.present ? control::admit(p.rig).verdict : control::Admissible::NotPositive;
    if (verdict != control::Admissible::Yes) config::refuse_haptic(path, control::to_text(verdict));
  }
  const auto open = [&](hal::EndpointBus& bus, const rig::BusEndpoint& endpoint, const char* name, std::span<const std::uint32_t> ids) {
    const hal::OpenStatus status = bus.open(endpoint, hal::BusSide::Rig, ids);
    if (status.error_number != 0) config::refuse_bus(path, name, "rig_port", status.message.data());
  };
  const auto drive_ids = hal::canopen::received_ids(p.rig);
  open(p.drives, p.rig.buses.drives, "drives", drive_ids.all());
  open(p.sensor, p.rig.buses.sensor, "sensor", hal::ati::received_ids(p.rig.buses.sensor_base_id));

  if (options.cpu >= 0 && !rt::leave_core(options.cpu))
    fmt::print(stderr, "trocar-rig: core {} cannot be left to the loop alone: this process has no other one (taskset -p)\n", options.cpu);
  virtual_needle::VirtualNeedle needle({p.rig.haptic.fade_s});
  std::optional<model_watch::ModelWatch> model;
  if (!options.model.empty())
    model.emplace(options.model, needle, [](const std::string& line) { fmt::print(stderr, "trocar-rig: {}\n", line); });

  if (wire::reach() == wire::Reach::Open && !options.open_network)
    throw config::UserError(
        "CYCLONEDDS_URI opens DDS to a network on which whoever is there may command this rig: unset it, name keys in TROCAR_KEYS (trocar "
        "keys "
        "makes them), or add --open-network where nobody else can be");
  bridge::Bridge bridge(p.rig, p.mail, p.shared, options.flight);
  LoopWatch watch(stall_limit_ns(p.rig, !options.best_effort));
  rt::Setup setup;
  const std::string missing = set_up(setup, options);
  const bool real_time = is_real_time(setup);
  if (!real_time && !options.best_effort)
    throw config::UserError(
        "the real-time set-up is incomplete (above): mend that (trocar rig check says more), or add --best-effort when no motor is "
        "connected");

  controller::Controller controller(p.rig, p.mail, real_time, &needle);
  bridge.report_real_time(real_time, missing, machine(setup, options, missing));
  fmt::print("trocar-rig: {} at {:g} Hz, DDS domain {}, {}\n", p.rig.name.data(), p.rig.timing.tick_hz, p.rig.dds_domain,
             real_time ? "real-time set-up complete" : "best effort");
  std::fflush(stdout);
  run_rig(p, controller, watch);
  fmt::print("trocar-rig: stopped in mode {}\n", to_string(controller.status().mode));
  return 0;
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): what adds options throws when they contradict each other, in any call
int main(int argc, char** argv) {
  Options options;
  bool die_with_parent = false;
  CLI::App app{"trocar-rig: the real-time controller of a rig.\nExample: trocar-rig --rig ubc_twin --best-effort"};
  app.add_option("--rig", options.rig, "rig name, or path of its TOML file")->capture_default_str();
  app.add_option("--model", options.model,
                 "model image for Haptic mode, from trocar scene compile; one that replaces it is taken while the rig runs");
  app.add_option("--domain", options.domain, "DDS domain instead of the rig file's")->check(CLI::Range(0, 230));
  app.add_option("--flight", options.flight, "folder for flight recordings: the last second before each fault, the newest 20 stay")
      ->capture_default_str();
  app.add_option("--cpu", options.cpu, "core to run on")->check(CLI::NonNegativeNumber);
  app.add_option("--priority", options.priority, "SCHED_FIFO priority")->check(CLI::Range(1, 99))->capture_default_str();
  app.add_flag("--open-network", options.open_network, "accept a network without keys (CYCLONEDDS_URI set, TROCAR_KEYS not)");
  app.add_flag("--best-effort", options.best_effort, "go on when the machine refuses part of the real-time set-up");
  auto* check_option =
      app.add_option("--check", options.check_s,
                     "run the loop for so many seconds without the rig, print as TOML what was granted and measured, and end "
                     "(trocar rig check shows it)")
          ->check(CLI::Range(0.1, 3600.0));
  app.add_option("--out", options.out, "file for that, instead of stdout")->needs(check_option);
  app.add_flag("--die-with-parent", die_with_parent, "stop orderly when the process that started this one ends");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  if (die_with_parent) prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of its writer, not the end of the controller
  try {
    return options.check_s > 0.0 ? check(options) : run(options);
  } catch (const std::exception& e) {
    fmt::print(stderr, "trocar-rig: {}\n", e.what());
    return 1;
  }
}
