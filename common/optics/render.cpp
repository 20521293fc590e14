#include "common/optics/render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

namespace trocar::optics {
namespace {

constexpr std::array<double, 3> slab{214.0, 206.0, 186.0};  // red, green, blue of the lit phantom in the middle of the image
constexpr double white = 250.0;
constexpr double dot_darkness = 0.86;
constexpr std::size_t noise_samples = 1U << 16U;  // a power of two

// Phi(x) by table: 1e-6 off at most, a twentieth of the cost of erf.
class NormalTable {
 public:
  static constexpr double end = 5.0;
  static constexpr int steps = 2000;
  NormalTable() {
    for (std::size_t i = 0; i < value_.size(); ++i)
      value_[i] = static_cast<float>(0.5 * std::erfc(-(-end + 2 * end * static_cast<double>(i) / steps) / std::numbers::sqrt2));
  }
  [[nodiscard]] float operator()(float x) const noexcept {
    if (x <= static_cast<float>(-end)) return 0.0F;
    if (x >= static_cast<float>(end)) return 1.0F;
    const float at = (x + static_cast<float>(end)) * static_cast<float>(steps / (2 * end));
    const int i = std::min(static_cast<int>(at), steps - 1);
    const float part = at - static_cast<float>(i);
    const auto k = static_cast<std::size_t>(i);
    return value_[k] + part * (value_[k + 1] - value_[k]);
  }

 private:
  std::array<float, steps + 1> value_{};
};
const NormalTable normal_cdf;

std::uint64_t mixed(std::uint64_t x) noexcept {  // splitmix64 (Steele, Lea and Flood 2014)
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

bool within(double x, double least, double most) noexcept { return x >= least && x <= most; }

void refuse_out_of_range(const Appearance& a, const MarkerGrid& grid) {
  const bool good = within(a.diameter_spread, 0.0, 0.5) && within(a.density_spread, 0.0, 0.9) && within(a.edge_wave, 0.0, 0.3) &&
                    within(a.hole_part, 0.0, 1.0) && within(a.light_fall, 0.0, 0.7) && within(a.shadow_depth, 0.0, 0.95) &&
                    within(a.shadow_width_m, 1e-5, 0.1) && within(a.spread_px, 0.1, 10.0) && within(a.exposure_s, 0.0, 1.0) &&
                    within(a.line_s, 0.0, 0.01) && within(a.read_noise, 0.0, 50.0) && within(a.shot_noise, 0.0, 10.0);
  if (!good) throw std::invalid_argument("appearance out of range");
  if (grid.rows < 1 || grid.columns < 1 || !(grid.spacing_m > 0.0) || !(grid.diameter_m > 0.0))
    throw std::invalid_argument("marker grid without markers");
}

// Which of red, green and blue a Bayer pixel sees.
std::size_t bayer_channel(int u, int v) noexcept { return v % 2 == 0 ? (u % 2 == 0 ? 0U : 1U) : (u % 2 == 0 ? 1U : 2U); }

}  // namespace

Appearance clean_appearance() noexcept { return {}; }

Appearance hard_appearance() noexcept {
  Appearance a;
  a.diameter_spread = 0.15;
  a.density_spread = 0.35;
  a.edge_wave = 0.04;
  a.hole_part = 0.2;
  a.light_fall = 0.35;
  a.shadow_depth = 0.35;
  a.spread_px = 0.9;
  a.exposure_s = 0.018;
  a.line_s = 1.0e-5;
  a.read_noise = 1.2;
  a.shot_noise = 0.03;
  return a;
}

Pose looking_down(const Camera& camera, const MarkerGrid& grid, double m_per_px) noexcept {
  const Lens& lens = camera.lens;
  const double depth = m_per_px * 0.5 * (lens.fx_px + lens.fy_px);
  // The ray of the image's middle, distortion left out: the grid lies about it as well as it needs to.
  const Ray middle = to_ray(lens, {0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)});
  const double x = 0.5 * (grid.columns - 1) * grid.spacing_m, y = 0.5 * (grid.rows - 1) * grid.spacing_m;
  return {{std::numbers::pi, 0.0, 0.0}, {middle.x * depth - x, middle.y * depth + y, depth}};
}

Renderer::Renderer(const Camera& camera, const Pose& plane, const MarkerGrid& grid, const Appearance& appearance, std::uint64_t seed)
    : camera_(camera), view_(camera.lens, plane), grid_(grid), appearance_(appearance), truth_(grid.markers()) {
  refuse_out_of_range(appearance, grid);
  std::mt19937_64 random(seed);
  // The distributions of the standard library differ from one to another; these do not.
  const auto uniform = [&random] { return static_cast<double>(random() >> 11U) * 0x1p-53; };
  for (std::size_t k = 0; k < grid.markers(); ++k) {
    Dot dot;
    dot.radius_m = 0.5 * grid.diameter_m * (1.0 + appearance.diameter_spread * (2.0 * uniform() - 1.0));
    dot.darkness = dot_darkness * (1.0 - appearance.density_spread * uniform());
    dot.wave = appearance.edge_wave * uniform();
    dot.wave_phase = 2.0 * std::numbers::pi * uniform();
    dot.waves = 3 + static_cast<int>(3.0 * uniform());
    const double hole = uniform(), direction = 2.0 * std::numbers::pi * uniform(), away = uniform(), size = uniform();
    if (hole < appearance.hole_part) {
      dot.hole_radius_m = dot.radius_m * (0.15 + 0.2 * size);
      const double offset = away * (0.8 * dot.radius_m - dot.hole_radius_m);
      dot.hole_x_m = offset * std::cos(direction);
      dot.hole_y_m = offset * std::sin(direction);
    }
    dots_.push_back(dot);
  }
  noise_.resize(noise_samples);
  for (std::size_t i = 0; i + 1 < noise_samples; i += 2) {  // Box and Muller 1958
    const double r = std::sqrt(-2.0 * std::log(1.0 - uniform())), a = 2.0 * std::numbers::pi * uniform();
    noise_[i] = static_cast<float>(r * std::cos(a));
    noise_[i + 1] = static_cast<float>(r * std::sin(a));
  }

  const auto width = static_cast<std::size_t>(camera.width_px), height = static_cast<std::size_t>(camera.height_px);
  const std::size_t samples = channels(appearance.format);
  plane_x_.resize(width * height);
  plane_y_.resize(width * height);
  base_.resize(width * height * samples);
  const double wave_u = 2.0 * std::numbers::pi * (0.6 + uniform()) / camera.width_px, phase = 2.0 * std::numbers::pi * uniform();
  const double radius2 =
      0.25 * (static_cast<double>(camera.width_px) * camera.width_px + static_cast<double>(camera.height_px) * camera.height_px);
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const auto at = view_.locate({static_cast<double>(u), static_cast<double>(v)});
      if (!at) throw std::invalid_argument("the camera does not see the phantom's plane in all of its image");
      const std::size_t i = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
      plane_x_[i] = static_cast<float>(at->x_m);
      plane_y_[i] = static_cast<float>(at->y_m);
      const double du = u - 0.5 * camera.width_px, dv = v - 0.5 * camera.height_px;
      const double fall = appearance.light_fall;
      const double light = 1.0 - fall * (du * du + dv * dv) / radius2 + fall / 3.0 * (du / camera.width_px) +
                           fall / 8.0 * std::sin(wave_u * u + 1.7 * wave_u * v + phase);
      const double grey = (slab[0] + slab[1] + slab[2]) / 3.0;
      if (samples == 3)
        for (std::size_t c = 0; c < 3; ++c) base_[3 * i + c] = static_cast<float>(slab[c] * light);
      else
        base_[i] = static_cast<float>(light * (appearance.format == PixelFormat::Mono8 ? grey : slab[bayer_channel(u, v)]));
    }
  }
  level_.resize(base_.size());
}

double Renderer::row_delay_s(double v_px) const noexcept { return (v_px - 0.5 * (camera_.height_px - 1)) * appearance_.line_s; }

void Renderer::draw_dot(const Dot& dot, const MarkerState& state, MarkerTruth& truth) noexcept {
  truth = {};
  // The row that the centre falls on says when it is exposed, and that where it is: a contraction, since a row is far shorter than a dot's
  // way.
  PlanePoint at = state.at;
  std::optional<Pixel> centre = view_.project(at);
  for (int k = 0; k < 3 && centre; ++k) {
    const double delay = row_delay_s(centre->v_px);
    at = {state.at.x_m + delay * state.vx_m_s, state.at.y_m + delay * state.vy_m_s};
    centre = view_.project(at);
  }
  if (!centre) return;
  truth.pixel = *centre;
  truth.at = at;
  const Jacobian2 j = view_.jacobian(at);
  const double scale = std::sqrt(std::abs(j[0][0] * j[1][1] - j[0][1] * j[1][0]));  // px per metre
  const double sigma = std::sqrt(appearance_.spread_px * appearance_.spread_px + 1.0 / 12.0);
  const double travel_px = scale * appearance_.exposure_s * std::hypot(state.vx_m_s, state.vy_m_s);
  const double reach = scale * dot.radius_m * (1.0 + dot.wave) * 1.1 + 4.0 * sigma + 0.5 * travel_px + 1.0;
  truth.visible = centre->u_px > reach && centre->u_px < camera_.width_px - 1 - reach && centre->v_px > reach &&
                  centre->v_px < camera_.height_px - 1 - reach;
  const int left = std::max(0, static_cast<int>(std::floor(centre->u_px - reach)));
  const int right = std::min(camera_.width_px - 1, static_cast<int>(std::ceil(centre->u_px + reach)));
  const int top = std::max(0, static_cast<int>(std::floor(centre->v_px - reach)));
  const int bottom = std::min(camera_.height_px - 1, static_cast<int>(std::ceil(centre->v_px + reach)));
  const int times = 1 + static_cast<int>(2.0 * travel_px);
  const auto sharp = static_cast<float>(scale / sigma);
  const auto radius = static_cast<float>(dot.radius_m), hole_radius = static_cast<float>(dot.hole_radius_m),
             wave = static_cast<float>(dot.wave);
  const auto darkness = static_cast<float>(dot.darkness / times), hole_part = static_cast<float>(1.0 / times);
  const std::size_t samples = channels(appearance_.format);
  for (int v = top; v <= bottom; ++v) {
    const double delay = row_delay_s(v);
    for (int u = left; u <= right; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(camera_.width_px) + static_cast<std::size_t>(u);
      float covered = 0.0F, holed = 0.0F;
      for (int k = 0; k < times; ++k) {
        const double t = delay + appearance_.exposure_s * ((k + 0.5) / times - 0.5);
        const auto dx = static_cast<float>(static_cast<double>(plane_x_[i]) - state.at.x_m - t * state.vx_m_s);
        const auto dy = static_cast<float>(static_cast<double>(plane_y_[i]) - state.at.y_m - t * state.vy_m_s);
        const float distance = std::sqrt(dx * dx + dy * dy);
        const float soft = static_cast<float>(NormalTable::end) / sharp + wave * radius;
        if (distance > radius + soft) continue;
        float edge = radius;
        if (wave > 0.0F && distance > radius - soft)
          edge *= 1.0F + wave * std::sin(static_cast<float>(dot.waves) * std::atan2(dy, dx) + static_cast<float>(dot.wave_phase));
        covered += darkness * normal_cdf((edge - distance) * sharp);
        if (hole_radius > 0.0F) {
          const float hx = dx - static_cast<float>(dot.hole_x_m), hy = dy - static_cast<float>(dot.hole_y_m);
          holed += hole_part * normal_cdf((hole_radius - std::sqrt(hx * hx + hy * hy)) * sharp);
        }
      }
      for (std::size_t c = 0; c < samples; ++c) {
        float& level = level_[samples * i + c];
        level *= 1.0F - covered;
        level += holed * (static_cast<float>(white) - level);
      }
    }
  }
}

void Renderer::draw_shadow(std::span<const PlanePoint> needle) noexcept {
  if (needle.size() < 2 || !(appearance_.shadow_depth > 0.0)) return;
  const double half = 0.5 * appearance_.shadow_width_m, soft = 0.25 * appearance_.shadow_width_m;
  const double reach_m = half + 3.0 * soft;
  // The part of the image that the line can darken.
  double left = camera_.width_px, right = 0.0, top = camera_.height_px, bottom = 0.0;
  for (const PlanePoint& p : needle) {
    for (const double sx : {-1.0, 1.0}) {
      for (const double sy : {-1.0, 1.0}) {
        const auto pixel = view_.project({p.x_m + sx * reach_m, p.y_m + sy * reach_m});
        if (!pixel) continue;
        left = std::min(left, pixel->u_px);
        right = std::max(right, pixel->u_px);
        top = std::min(top, pixel->v_px);
        bottom = std::max(bottom, pixel->v_px);
      }
    }
  }
  const int u0 = std::max(0, static_cast<int>(left)), u1 = std::min(camera_.width_px - 1, static_cast<int>(right) + 1);
  const int v0 = std::max(0, static_cast<int>(top)), v1 = std::min(camera_.height_px - 1, static_cast<int>(bottom) + 1);
  const std::size_t samples = channels(appearance_.format);
  for (int v = v0; v <= v1; ++v) {
    for (int u = u0; u <= u1; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(camera_.width_px) + static_cast<std::size_t>(u);
      double nearest2 = reach_m * reach_m;
      for (std::size_t k = 0; k + 1 < needle.size(); ++k) {
        const double ex = needle[k + 1].x_m - needle[k].x_m, ey = needle[k + 1].y_m - needle[k].y_m;
        const double px = static_cast<double>(plane_x_[i]) - needle[k].x_m, py = static_cast<double>(plane_y_[i]) - needle[k].y_m;
        const double length2 = ex * ex + ey * ey;
        const double along = length2 > 0.0 ? std::clamp((px * ex + py * ey) / length2, 0.0, 1.0) : 0.0;
        const double dx = px - along * ex, dy = py - along * ey;
        nearest2 = std::min(nearest2, dx * dx + dy * dy);
      }
      if (nearest2 >= reach_m * reach_m) continue;
      const float light =
          1.0F - static_cast<float>(appearance_.shadow_depth) * normal_cdf(static_cast<float>((half - std::sqrt(nearest2)) / soft));
      for (std::size_t c = 0; c < samples; ++c) level_[samples * i + c] *= light;
    }
  }
}

void Renderer::expose(std::uint64_t number, Frame& frame) const noexcept {
  const std::size_t row = static_cast<std::size_t>(camera_.width_px) * channels(appearance_.format);
  const auto read2 = static_cast<float>(appearance_.read_noise * appearance_.read_noise);
  const auto shot = static_cast<float>(appearance_.shot_noise);
  const bool noisy = read2 > 0.0F || shot > 0.0F;
  for (std::size_t v = 0; v < static_cast<std::size_t>(camera_.height_px); ++v) {
    const float* level = &level_[v * row];
    std::uint8_t* out = &frame.pixels[v * row];
    if (!noisy) {
      for (std::size_t k = 0; k < row; ++k) out[k] = static_cast<std::uint8_t>(std::min(level[k] + 0.5F, 255.0F));
      continue;
    }
    // A stretch of the table, begun anew where it ends.
    std::uint64_t bits = mixed(number * 0x100000001B3ULL + v);
    for (std::size_t k = 0; k < row;) {
      const std::size_t begin = bits % noise_samples;
      const std::size_t count = std::min(row - k, noise_samples - begin);
      const float* noise = &noise_[begin];
      for (std::size_t i = 0; i < count; ++i) {
        const float value = level[k + i] + noise[i] * std::sqrt(read2 + shot * level[k + i]) + 0.5F;
        out[k + i] = static_cast<std::uint8_t>(std::min(std::max(value, 0.0F), 255.0F));
      }
      k += count;
      bits = mixed(bits);
    }
  }
}

void Renderer::render(std::span<const MarkerState> markers, std::span<const PlanePoint> needle, std::uint64_t number, std::int64_t time_ns,
                      Frame& frame) {
  if (markers.size() != dots_.size()) throw std::invalid_argument("as many markers as the grid has");
  frame.number = number;
  frame.time_ns = time_ns;
  frame.width_px = camera_.width_px;
  frame.height_px = camera_.height_px;
  frame.format = appearance_.format;
  frame.pixels.resize(base_.size());
  std::ranges::copy(base_, level_.begin());
  draw_shadow(needle);
  for (std::size_t k = 0; k < dots_.size(); ++k) draw_dot(dots_[k], markers[k], truth_[k]);
  expose(number, frame);
}

}  // namespace trocar::optics
