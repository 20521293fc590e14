#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "host/tracking/locate.hpp"

namespace trocar::tracking {
namespace {

constexpr int rays = 48;
constexpr int passes = 3;                // rays anew from the centre found; each reaches less far than the one before
constexpr int reweightings = 4;          // in the last of them
constexpr double oval_part = 0.015;      // of the radius: how far dots are expected to be from round, on two axes of ovality
constexpr double tukey = 4.685;          // 95 % efficient for normal noise
constexpr double tukey_variance = 0.83;  // of a normal residual that its weights leave: (1 - 6 / c^2 + 15 / c^4) / (1 - 2 / c^2 + 3 / c^4)
constexpr int most_reach_px = 32;        // along a ray, to either side of the edge
constexpr double least_scale_px = 0.03;
constexpr float hole_px = 0.3F;                      // half-way point and integral further apart than this: something lies on the ray
constexpr double most_deviation_px = 0.2;            // of a centre that is believed
constexpr double agree_px = 0.75, agree_part = 0.1;  // of the radius: a ray within the larger of them supports the outline

struct Directions {
  std::array<double, rays> cosine{}, sine{};
  std::array<Eigen::Matrix<double, 5, 1>, rays> basis{};  // 1, cos, sin, cos 2, sin 2
  Directions() {
    for (std::size_t k = 0; k < rays; ++k) {
      const double a = 2.0 * std::numbers::pi * static_cast<double>(k) / rays;
      cosine[k] = std::cos(a);
      sine[k] = std::sin(a);
      basis[k] << 1.0, cosine[k], sine[k], std::cos(2.0 * a), std::sin(2.0 * a);
    }
  }
};
const Directions direction;

struct Levels {
  float dark{}, bright{};
};

// A twentieth of the window is darker than `dark`, a quarter brighter than `bright`.
Levels levels_of(const Window& window) noexcept {
  std::array<std::uint32_t, 64> histogram{};
  for (const float level : window.level) ++histogram[static_cast<std::size_t>(std::clamp(level, 0.0F, 255.0F)) / 4U];
  const auto n = static_cast<std::uint32_t>(window.level.size());
  Levels out;
  std::uint32_t seen = 0;
  for (std::size_t k = 0; k < histogram.size(); ++k) {
    if (seen < n / 20) out.dark = 4.0F * static_cast<float>(k) + 2.0F;
    if (seen < n - n / 4) out.bright = 4.0F * static_cast<float>(k) + 2.0F;
    seen += histogram[k];
  }
  return out;
}

// Centroid of what is darker than halfway, weighted by how much, within a circle about the window's middle.
struct Blob {
  double u_px{}, v_px{};
  double area_px{};
};
Blob blob_of(const Window& window, const Levels& levels, double within_px) noexcept {
  const float half = 0.5F * (levels.dark + levels.bright);
  const int middle = window.width / 2;
  double weight = 0.0, su = 0.0, sv = 0.0;
  Blob blob;
  for (int v = 0; v < window.height; ++v) {
    const double room = within_px * within_px - static_cast<double>(v - middle) * (v - middle);
    if (room < 0.0) continue;
    const int reach = std::min(middle, static_cast<int>(std::sqrt(room)));
    float row = 0.0F, moment = 0.0F;
    int count = 0;
    for (int u = middle - reach; u <= middle + reach; ++u) {
      const float depth = std::max(0.0F, half - window.at(u, v));
      row += depth;
      moment += depth * static_cast<float>(u);
      count += depth > 0.0F ? 1 : 0;
    }
    weight += static_cast<double>(row);
    su += static_cast<double>(moment);
    sv += static_cast<double>(row) * v;
    blob.area_px += count;
  }
  if (weight > 0.0) {
    blob.u_px = window.left + su / weight;
    blob.v_px = window.top + sv / weight;
  }
  return blob;
}

float between_pixels(const Window& window, float u, float v) noexcept {
  u = std::clamp(u, 0.0F, static_cast<float>(window.width) - 1.001F);
  v = std::clamp(v, 0.0F, static_cast<float>(window.height) - 1.001F);
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
  const float* p = &window.level[static_cast<std::size_t>(y) * static_cast<std::size_t>(window.width) + static_cast<std::size_t>(x)];
  const float* q = p + window.width;
  const float top = p[0] + a * (p[1] - p[0]), bottom = q[0] + a * (q[1] - q[0]);
  return top + b * (bottom - top);
}

// Distance of the edge from the centre on each ray; NaN where the levels show none.
void find_edges(const Window& window, double u, double v, double radius, double reach, float contrast, float tolerance,
                std::vector<float>& edge) noexcept {
  constexpr int ends = 2;  // samples whose mean is the level inside, and outside
  const int samples = 2 * static_cast<int>(std::ceil(reach)) + 1;
  const auto first = static_cast<float>(radius - 0.5 * (samples - 1));
  edge.assign(rays, std::nanf(""));
  std::array<float, 2 * most_reach_px + 1> level{};
  for (std::size_t k = 0; k < rays; ++k) {
    const auto c = static_cast<float>(direction.cosine[k]), s = static_cast<float>(direction.sine[k]);
    const float u0 = static_cast<float>(u - window.left), v0 = static_cast<float>(v - window.top);
    for (int i = 0; i < samples; ++i) {
      const float along = first + static_cast<float>(i);
      level[static_cast<std::size_t>(i)] = between_pixels(window, u0 + along * c, v0 + along * s);
    }
    float inside = 0.0F, outside = 0.0F;
    for (int i = 0; i < ends; ++i) {
      inside += level[static_cast<std::size_t>(i)] / ends;
      outside += level[static_cast<std::size_t>(samples - 1 - i)] / ends;
    }
    const float step = outside - inside;
    if (step < contrast) continue;
    float sum = 0.0F;
    for (int i = 0; i < samples; ++i) sum += std::clamp((outside - level[static_cast<std::size_t>(i)]) / step, -0.25F, 1.25F);
    const float e = first + sum - 0.5F;
    // Where half of the step is passed, from outside: the same place unless something lies on the ray, such as a hole.
    const float half = 0.5F * (inside + outside);
    int i = samples - 1;
    while (i > 0 && level[static_cast<std::size_t>(i)] > half) --i;
    const float below = level[static_cast<std::size_t>(i)], above = level[static_cast<std::size_t>(std::min(i + 1, samples - 1))];
    const float crossing = first + static_cast<float>(i) + (above > below ? (half - below) / (above - below) : 0.0F);
    if (std::abs(crossing - e) > tolerance) continue;
    edge[k] = e;
  }
}

struct Outline {
  double du{}, dv{}, radius{};
  std::array<double, 2> oval{};
  double agreeing{};      // part of the rays
  double deviation_px{};  // of the centre, if each ray strayed as the median one does
  std::array<double, 3> covariance{};
};

float median_of(std::vector<float>& values) noexcept {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

// Least squares of e = r + du cos + dv sin + oval (cos 2, sin 2) with Tukey's biweight. `oval` is drawn towards what is known of it.
bool fit_outline(Scratch& s, double radius, const std::array<double, 2>& oval, double oval_deviation_px, int rounds,
                 Outline& out) noexcept {
  s.weight.assign(rays, 1.0F);
  s.residual.assign(rays, 0.0F);
  s.sorted.clear();
  // A first radius that half of the rays may spoil: the median.
  for (const float e : s.edge)
    if (!std::isnan(e)) s.sorted.push_back(e);
  if (s.sorted.size() < rays / 3) return false;
  Vector5 x;
  x << static_cast<double>(median_of(s.sorted)), 0.0, 0.0, oval[0], oval[1];
  if (!(x[0] > 0.3 * radius)) return false;
  for (int round = 0; round < rounds; ++round) {
    s.sorted.clear();
    for (std::size_t k = 0; k < rays; ++k) {
      if (std::isnan(s.edge[k])) continue;
      s.residual[k] = s.edge[k] - static_cast<float>(direction.basis[k].dot(x));
      s.sorted.push_back(std::abs(s.residual[k]));
    }
    const double scale = std::max(least_scale_px, static_cast<double>(median_of(s.sorted)) / 0.6745), limit = tukey * scale;
    Matrix5 normal = Matrix5::Zero();
    Vector5 right = Vector5::Zero();
    double n = 0.0, squares = 0.0;
    for (std::size_t k = 0; k < rays; ++k) {
      if (std::isnan(s.edge[k])) continue;
      const double r = static_cast<double>(s.residual[k]) / limit;
      if (std::abs(r) >= 1.0) continue;
      const double w = (1.0 - r * r) * (1.0 - r * r);
      const Vector5 weighted = w * direction.basis[k];
      normal.noalias() += weighted * direction.basis[k].transpose();
      right += static_cast<double>(s.edge[k]) * weighted;
      squares += w * static_cast<double>(s.residual[k]) * static_cast<double>(s.residual[k]);
      n += w;
    }
    if (n < rays / 4.0) return false;
    const double pull = scale * scale / (oval_deviation_px * oval_deviation_px);
    for (const Eigen::Index k : {3, 4}) {
      normal(k, k) += pull;
      right[k] += pull * oval[static_cast<std::size_t>(k) - 3U];
    }
    const Eigen::LLT<Matrix5> factor(normal);
    if (factor.info() != Eigen::Success) return false;
    x = factor.solve(right);
    const Matrix5 inverse = factor.solve(Matrix5::Identity());
    const double variance = squares / (tukey_variance * std::max(1.0, n - 5.0));
    out.deviation_px = scale * std::sqrt(inverse(1, 1) + inverse(2, 2));
    out.covariance = {variance * inverse(1, 1), variance * inverse(1, 2), variance * inverse(2, 2)};
  }
  const double near = std::max(agree_px, agree_part * x[0]);
  out.agreeing = 0.0;
  for (std::size_t k = 0; k < rays; ++k)
    if (std::abs(static_cast<double>(s.edge[k]) - direction.basis[k].dot(x)) < near) out.agreeing += 1.0 / rays;
  out.radius = x[0];
  out.du = x[1];
  out.dv = x[2];
  out.oval = {x[3], x[4]};
  return true;
}

}  // namespace

Located locate_by_edge(const optics::Frame& frame, const Gains& gains, const Place& start, double radius_px, Scratch& scratch) {
  Located out;
  constexpr int most_recentred = 4;
  const double search = std::max(8.0, 0.7 * radius_px);
  const int half = static_cast<int>(std::ceil(radius_px + search)) + 1;
  Place centre = start;
  Levels levels;
  Blob blob;
  bool there = false;
  for (int k = 0; k < most_recentred && !there; ++k) {
    const int u = static_cast<int>(std::lround(centre.u_px)), v = static_cast<int>(std::lround(centre.v_px));
    if (u < 0 || v < 0 || u >= frame.width_px || v >= frame.height_px) return out;
    take_window(frame, Grey::Balanced, gains, u - half, v - half, 2 * half + 1, 2 * half + 1, scratch.window);
    levels = levels_of(scratch.window);
    if (levels.bright - levels.dark < least_contrast) return out;
    blob = blob_of(scratch.window, levels, half);
    const double area = std::numbers::pi * radius_px * radius_px;
    if (blob.area_px < 0.25 * area || blob.area_px > 2.5 * area) return out;
    there = std::hypot(blob.u_px - u, blob.v_px - v) < 0.25 * search;
    centre = {blob.u_px, blob.v_px};
  }
  if (!there) return out;

  double radius = std::clamp(std::sqrt(blob.area_px / std::numbers::pi), 0.7 * radius_px, 1.4 * radius_px);
  const double least_reach = std::min(4.0, 0.65 * radius_px);
  double reach = std::clamp(0.45 * radius_px, least_reach, static_cast<double>(most_reach_px));
  Outline outline;
  for (int k = 0; k < passes; ++k) {
    find_edges(scratch.window, centre.u_px, centre.v_px, radius, reach, 0.35F * (levels.bright - levels.dark), k == 0 ? 9.0F : hole_px,
               scratch.edge);
    if (!fit_outline(scratch, radius_px, {}, oval_part * radius_px, k + 1 < passes ? 2 : reweightings, outline)) return out;
    centre.u_px += outline.du;
    centre.v_px += outline.dv;
    radius = outline.radius;
    if (std::hypot(centre.u_px - blob.u_px, centre.v_px - blob.v_px) > search) return out;
    reach = least_reach;
  }
  out.u_px = centre.u_px;
  out.v_px = centre.v_px;
  out.radius_px = radius;
  out.score = std::min(1.0, outline.agreeing);
  // Rays less than two pixels apart at the edge share their samples' noise.
  const double shared = std::max(1.0, rays * 2.0 / (2.0 * std::numbers::pi * std::max(radius, 1.0)));
  for (std::size_t k = 0; k < 3; ++k) out.covariance[k] = shared * outline.covariance[k];
  if (outline.deviation_px > most_deviation_px) return out;  // the rays left are all on one side
  out.found = out.score >= least_rays && radius > 0.6 * radius_px && radius < 1.6 * radius_px && std::isfinite(radius);
  return out;
}

}  // namespace trocar::tracking
