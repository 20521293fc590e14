#include "tests/targets/replay.hpp"

#include <cmath>
#include <limits>

#include "tests/targets/line.hpp"

namespace trocar::targets {
namespace {

using Name = std::array<char, 24>;

// Largest error allowed, relative to the quantity's largest value in the case. README.md says where they come from.
struct Bound {
  double float64;
  double float32;
};
constexpr Bound bound_of(const Name&) noexcept { return {1e-12, 1e-2}; }

double error_of(double value, double expected, double scale) noexcept {
  if (std::isnan(value) && std::isnan(expected)) return 0.0;
  const double error = std::abs(value - expected);
  if (error == 0.0) return 0.0;
  // Also where one of the two is no number.
  return scale > 0.0 && std::isfinite(error) ? error / scale : std::numeric_limits<double>::infinity();
}

struct Found {
  std::uint64_t vectors{};
  double error{};
  const char* where{"-"};
  std::uint64_t at{};  // vector
  std::uint64_t decisions{};  // vectors with one that differs
  std::uint64_t cost_least{std::numeric_limits<std::uint64_t>::max()}, cost_most{}, cost_sum{};
};

// Case after case: name, kind, vectors, scale of each quantity; the case's beginning; then inputs, values and decisions of each vector.
template <class Case>
bool run(Case& fresh, Reader& in, Memory& memory, const model::Image& image, const Platform& platform, Wrong wrong, double bound,
         Found& found) {
  std::array<double, most_quantities> scale{};
  in(found.vectors);
  for (std::size_t q = 0; q < Case::quantities.size(); ++q) in(scale[q]);
  fresh.open(in, memory, image);
  for (std::uint64_t k = 0; k < found.vectors && in.ok(); ++k) {
    static Answer answer;
    answer = {};
    fresh.step(in, answer, platform.now);
    std::size_t i = 0;
    for (std::size_t q = 0; q < Case::quantities.size(); ++q)
      for (std::size_t c = 0; c < Case::quantities[q].size; ++c, ++i) {
        double expected{};
        in(expected);
        if (wrong == Wrong::Value && k == 0 && q + 1 == Case::quantities.size()) {
          // NaN where there is nothing yet, as before Haptic: then there must be none.
          expected = std::isnan(expected) ? 0.0 : expected + 2.0 * bound * scale[q];
        }
        const double error = error_of(answer.value[i], expected, scale[q]);
        if (error > found.error) {
          found.error = error;
          found.where = Case::quantities[q].name;
          found.at = k;
        }
      }
    bool differs = false;
    for (std::size_t d = 0; d < answer.decisions; ++d) {
      std::int64_t expected{};
      in(expected);
      if (wrong == Wrong::Decision && k == 0 && d == 0) ++expected;
      differs = differs || expected != answer.decision[d];
    }
    if (differs) ++found.decisions;
    found.cost_least = std::min(found.cost_least, answer.cost);
    found.cost_most = std::max(found.cost_most, answer.cost);
    found.cost_sum += answer.cost;
  }
  return in.ok();
}

}  // namespace

bool replay(std::span<const std::byte> golden, std::span<const std::byte> image_bytes, Memory& memory, const Platform& platform,
            Wrong wrong) noexcept {
  Line line;
  constexpr bool is_float64 = std::is_same_v<Scalar, double>;
  platform.print(line.text(platform.name).text(is_float64 ? ", float64" : ", float32").end());
  model::Image image{};
  if (!open_image(image_bytes, memory, image)) {
    platform.print("the model image cannot be opened\n");
    return false;
  }
  platform.print(line.text("case", 18)
                     .text("vectors  error    bound    at, quantity", 60)
                     .text("decisions   instructions: least      mean      most")
                     .end());
  Reader in(golden);
  bool good = true;
  std::uint64_t cases = 0;
  while (true) {
    Name name{};
    Kind kind{};
    in(kind);
    if (kind == Kind::End || !in.ok()) break;
    for (char& c : name) in(c);
    const double bound = is_float64 ? bound_of(name).float64 : bound_of(name).float32;
    Found found;
    bool whole = false;
    const bool known =
        with_case(kind, [&](auto& fresh) { whole = run(fresh, in, memory, image, platform, wrong, bound, found); });
    if (!known || !whole) break;
    ++cases;
    // A float32 build may decide a step earlier or later; what that does to the values is within the bound.
    const bool passed = found.vectors > 0 && found.error <= bound && (!is_float64 || found.decisions == 0);
    good = good && passed;
    line.text(name.data(), 18).number(found.vectors, 7).text("  ").scientific(found.error).text("  ").scientific(bound).text("  ");
    line.number(found.at, 5).text(" ").text(found.where, 27).number(found.decisions, 9);
    line.number(found.cost_least, 22).number(found.cost_sum / std::max<std::uint64_t>(1, found.vectors), 10).number(found.cost_most, 10);
    platform.print(line.text(passed ? "  pass" : "  FAIL").end());
  }
  if (!in.ok() || !in.at_end() || cases == 0) {
    platform.print("the golden vectors end too early, or go on where they should end\n");
    return false;
  }
  return good;
}

}  // namespace trocar::targets
