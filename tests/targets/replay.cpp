#include "tests/targets/replay.hpp"

#include <cmath>
#include <limits>
#include <string_view>

#include "tests/targets/line.hpp"

namespace trocar::targets {
namespace {

using Name = std::array<char, 24>;

// Largest error allowed, relative to the quantity's largest value in the case. In float64 it is the same for all. In float32 it is what is
// left of single precision's 6e-8:
//   tick      a joint angle of 2 rad is rounded by 1e-7 rad, an encoder's resolution aside; the velocity observers (300 rad/s) make 4e-5
//   rad/s
//             of it, damping gains some 1e-3 of the largest forces
//   contact   a place 0.25 m from the origin is rounded by 1.5e-8 m, 4e-6 N over a contact's own compliance of 4e-3 m/N; the solver ends
//             below 1e-4 N (contact/solver.hpp), over forces of 0.36 N
//   adapt     where the tip springs back as a node is moved onto its way, the crossing may be found a step of the base, 0.16 mm, earlier or
//             later: half of it at the tip's 68 N/m, over 0.54 N
//   bending   twice as much as contact: tissue and needle each end below 1e-4 N (insertion/flexible.hpp)
//   beam      Newton ends below 1e-5 rad of the last step, so rounding alone is left: angles of 2 rad, some hundred terms
constexpr double float64_bound = 1e-12;
struct Float32Bound {
  std::string_view name;
  double bound;
};
constexpr std::array<Float32Bound, 6> float32_bounds{{{"tick, position", 2e-3},
                                                      {"tick, haptic", 2e-3},
                                                      {"contact, embedded", 3e-4},
                                                      {"contact, adapt", 1e-2},
                                                      {"bending needle", 6e-4},
                                                      {"beam", 3e-4}}};
constexpr bool is_float64 = std::is_same_v<Scalar, double>;
// What float32 may decide a step earlier or later, in so many of a hundred vectors. Such a vector's values are not compared: they differ by
// that step.
constexpr std::uint64_t decisions_per_hundred = is_float64 ? 0 : 2;

double bound_of(std::string_view name) noexcept {
  if (is_float64) return float64_bound;
  for (const Float32Bound& known : float32_bounds)
    if (name == known.name) return known.bound;
  return 0.0;
}

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
  std::uint64_t at{};         // vector
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
    double error = 0.0;
    const char* where = "-";
    for (std::size_t q = 0; q < Case::quantities.size(); ++q)
      for (std::size_t c = 0; c < Case::quantities[q].size; ++c, ++i) {
        double expected{};
        in(expected);
        if (wrong == Wrong::Value && k == 0 && q == 0) expected += 2.0 * bound * scale[q];
        const double difference = error_of(answer.value[i], expected, scale[q]);
        if (difference > error) {
          error = difference;
          where = Case::quantities[q].name;
        }
      }
    bool differs = false;
    for (std::size_t d = 0; d < answer.decisions; ++d) {
      std::int64_t expected{};
      in(expected);
      if (wrong == Wrong::Decision && d == 0 && 100 * k <= decisions_per_hundred * found.vectors) ++expected;
      differs = differs || expected != answer.decision[d];
    }
    if (differs) ++found.decisions;
    if (error > found.error && (!differs || is_float64)) {
      found.error = error;
      found.where = where;
      found.at = k;
    }
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
    const double bound = bound_of(name.data());
    Found found;
    bool whole = false;
    const bool known = with_case(kind, [&](auto& fresh) { whole = run(fresh, in, memory, image, platform, wrong, bound, found); });
    if (!known || !whole) break;
    ++cases;
    const bool passed = found.vectors > 0 && found.error <= bound && 100 * found.decisions <= decisions_per_hundred * found.vectors;
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
