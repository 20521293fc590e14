// A person inserts a virtual flexible needle with 32 contacts and more, the real controller at 1 kHz and 4 kHz in real time for 60 s each.
// Goal: 99 % of the ticks with that many contacts take less than half a period. Exit code 1 when a rate misses it, or when the course is
// not what it should be (left Haptic, no solution, too few contacts). --quick: 1 s each, and times are not judged.
//   realtime_benchmark [--out FOLDER] [--quick]
#include <fmt/core.h>

#include <cstdio>
#include <memory>
#include <vector>

#include "common/image_file/mapped_image.hpp"
#include "tests/benchmarks/program/program.hpp"
#include "tests/benchmarks/realtime/course.hpp"
#include "tests/benchmarks/realtime/cyclictest.hpp"
#include "tests/benchmarks/realtime/output.hpp"
#include "tests/benchmarks/realtime/paced.hpp"

namespace trocar::bench {
namespace {

constexpr const char* name = "realtime_benchmark";

int run(const Options& options) {
  const std::filesystem::path model = options.out / "realtime_model.image";
  step(name, "compiling the model", [&] { compile_model(model); });
  const image_file::MappedImage image(model, image_file::Lock::Yes);
  std::filesystem::remove(model);  // stays mapped
  const int seconds = options.quick ? 1 : 60;

  std::vector<Rate> rates;
  for (const double hz : {1000.0, 4000.0}) {
    Rate rate;
    std::unique_ptr<Cyclictest> other;
    step(name, fmt::format("{:.0f} Hz for {} s", hz, seconds), [&] {
      rate.paced = run_paced(hz, seconds, image.image(), [&](bool fifo) {
        other =
            std::make_unique<Cyclictest>(static_cast<int>(1e6 / hz), seconds, fifo, cores().other, options.out / "realtime_cyclictest.txt");
      });
      rate.cyclictest = other->result();
    });
    step(name, "the same ticks at no pace", [&] { repeat(rate.paced, image.image(), options.quick ? 1 : 2); });
    rates.push_back(std::move(rate));
  }

  for (const std::string& line : rates.front().paced.refused) fmt::print("not granted: {}\n", line);
  if (rates.front().paced.refused.empty()) fmt::print("the machine granted the whole real-time set-up\n");
  if (cores().ours >= 0) fmt::print("ours on core {}, cyclictest on core {}\n", cores().ours, cores().other);
  for (const Rate& rate : rates) print(rate);
  fmt::print("\n");
  bool met = true;
  for (const Rate& rate : rates) {
    const bool within = judged_us(rate) < rate.half_period_us();
    met = met && sound(rate) && (within || options.quick);
    fmt::print("{:.0f} Hz: 99 % of the ticks with {} contacts within {:.1f} us, half a period is {:.0f} us: {}\n", rate.paced.tick_hz,
               contacts_goal, judged_us(rate), rate.half_period_us(),
               options.quick ? "not judged, too short"
               : within      ? "met"
                             : "MISSED");
  }
  write(options.out, rates);
  fmt::print("tables and figures: {}\n", options.out.string());
  return met ? 0 : 1;
}

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program(trocar::bench::name, count, argument, trocar::bench::run); }
