#include "tests/benchmarks/realtime/paced.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <memory>
#include <thread>

#include "hal/realtime/clock.hpp"
#include "hal/realtime/setup.hpp"

namespace trocar::bench {
namespace {

namespace rt = hal::realtime;

std::int64_t cpu_now_ns() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * 1'000'000'000 + now.tv_nsec;
}

std::int32_t involuntary_switches() noexcept {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return static_cast<std::int32_t>(usage.ru_nivcsw);
}

// Eighth number of the first line, in clock ticks.
double steal_s() {
  std::ifstream file("/proc/stat");
  std::string name;
  double value = 0.0;
  file >> name;
  for (int k = 0; k < 8; ++k) file >> value;
  return file ? value / static_cast<double>(::sysconf(_SC_CLK_TCK)) : 0.0;
}

void take_setup(rt::Setup& setup, Paced& paced) {
  setup.apply({.cpu = cores().ours});
  for (std::size_t i = 0; i < rt::item_count; ++i) {
    const auto item = static_cast<rt::Item>(i);
    const rt::Outcome& outcome = setup.outcome(item);
    if (!outcome.asked || outcome.obtained) continue;
    std::array<char, 256> line{};
    rt::describe(item, outcome, line);
    paced.refused.emplace_back(line.data());
  }
  paced.fifo = setup.outcome(rt::Item::Scheduler).obtained;
}

void loop(Course& course, Paced& paced) noexcept {
  const std::int64_t period_ns = course.period_ns();
  const std::int64_t start_ns = rt::monotonic_now_ns();
  std::int64_t next_ns = start_ns + period_ns;
  for (Tick& tick : paced.tick) {
    rt::sleep_until(next_ns);
    tick.late_ns = rt::monotonic_now_ns() - next_ns;
    const controller::TickInput input = course.begin(tick.late_ns);
    const std::int32_t switches = involuntary_switches();
    const std::int64_t cpu_ns = cpu_now_ns();
    const std::int64_t begin_ns = rt::monotonic_now_ns();
    const hal::LinkCommand& command = course.controller().tick(input);
    const std::int64_t end_ns = rt::monotonic_now_ns();
    tick.cpu_ns = cpu_now_ns() - cpu_ns;
    tick.wall_ns = tick.least_ns = end_ns - begin_ns;
    tick.switches = involuntary_switches() - switches;
    const std::int64_t plant_ns = rt::monotonic_now_ns();
    course.end(command);
    tick.counts = course.counts();
    paced.haptic = paced.haptic && course.haptic();
    const std::int64_t done_ns = rt::monotonic_now_ns();
    tick.plant_ns = done_ns - plant_ns;

    // As in trocar-rig: a missed period is not made up for by a burst.
    next_ns += period_ns;
    if (done_ns > next_ns + period_ns) {
      const std::int64_t missed = (done_ns - next_ns) / period_ns;
      paced.missed_periods += missed;
      next_ns += missed * period_ns;
    }
  }
  paced.wall_s = 1e-9 * static_cast<double>(rt::monotonic_now_ns() - start_ns);
}

}  // namespace

// The last and the first that this process may use: interrupts gather on the first.
Cores cores() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (::sched_getaffinity(0, sizeof allowed, &allowed) != 0 || CPU_COUNT(&allowed) < 2) return {};
  Cores found;
  for (int core = 0; core < CPU_SETSIZE; ++core)
    if (CPU_ISSET(static_cast<std::size_t>(core), &allowed)) {
      if (found.other < 0) found.other = core;
      found.ours = core;
    }
  return found;
}

Paced run_paced(double tick_hz, double seconds, const model::Image& image, const std::function<void(bool fifo)>& begins) {
  Paced paced;
  paced.tick_hz = tick_hz;
  paced.tick.resize(static_cast<std::size_t>(tick_hz * seconds));
  const auto course = std::make_unique<Course>(tick_hz, image);
  std::exception_ptr error;
  // A thread of its own: what is started from here, gnuplot too, shall not inherit its priority.
  std::thread thread([&] {
    try {
      rt::Setup setup;
      take_setup(setup, paced);
      begins(paced.fifo);
      const double before_s = steal_s();
      loop(*course, paced);
      paced.steal_s = steal_s() - before_s;
    } catch (...) {
      error = std::current_exception();
    }
  });
  thread.join();
  if (error) std::rethrow_exception(error);
  return paced;
}

void repeat(Paced& paced, const model::Image& image, int times) {
  for (int k = 0; k < times; ++k) {
    const auto course = std::make_unique<Course>(paced.tick_hz, image);
    for (Tick& tick : paced.tick) {
      const controller::TickInput input = course->begin(0);
      const std::int64_t begin_ns = rt::monotonic_now_ns();
      const hal::LinkCommand& command = course->controller().tick(input);
      tick.least_ns = std::min(tick.least_ns, rt::monotonic_now_ns() - begin_ns);
      course->end(command);
      paced.same = paced.same && course->counts() == tick.counts;
    }
  }
}

}  // namespace trocar::bench
