#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "host/tracking/locate.hpp"

namespace trocar::tracking {
namespace {

constexpr int most_recentred = 6;
constexpr double hole_part = 0.4;  // of the radius: holes up to this size are filled

}  // namespace

Disc::Disc(double radius_px) : radius_(radius_px) {
  const int margin = static_cast<int>(std::ceil(radius_px)) + 3;
  width_ = 2 * margin + 1;
  for (int y = -margin; y <= margin; ++y) {
    const double left = radius_px * radius_px - static_cast<double>(y) * y;
    reach_.push_back(left >= 0.0 ? static_cast<int>(std::floor(std::sqrt(left))) : -1);
    pixels_ += 2 * reach_.back() + 1;
    if (reach_.back() < 0) pixels_ += 1;
  }
}

void correlate(const std::vector<float>& darkness, int width, int height, const Disc& disc, std::vector<float>& sums,
               std::vector<float>& squares, std::vector<float>& coefficients) {
  // Running sums of each row, from 0.
  const auto stride = static_cast<std::size_t>(width) + 1;
  sums.resize(stride * static_cast<std::size_t>(height));
  squares.resize(sums.size());
  for (int y = 0; y < height; ++y) {
    const float* in = &darkness[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)];
    float* s = &sums[static_cast<std::size_t>(y) * stride];
    float* q = &squares[static_cast<std::size_t>(y) * stride];
    s[0] = q[0] = 0.0F;
    for (int x = 0; x < width; ++x) {
      s[x + 1] = s[x] + in[x];
      q[x + 1] = q[x] + in[x] * in[x];
    }
  }
  const int places_u = width - disc.width() + 1, places_v = height - disc.width() + 1;
  coefficients.assign(static_cast<std::size_t>(places_u) * static_cast<std::size_t>(places_v), 0.0F);
  const int middle = disc.width() / 2;
  const auto n = static_cast<double>(disc.width()) * disc.width();
  const double part = disc.pixels() / n;
  const double spread = disc.pixels() * (1.0 - part);
  std::vector<float> whole(static_cast<std::size_t>(places_u)), square(whole.size()), inside(whole.size());
  for (int v = 0; v < places_v; ++v) {
    std::ranges::fill(whole, 0.0F);
    std::ranges::fill(square, 0.0F);
    std::ranges::fill(inside, 0.0F);
    for (int y = 0; y < disc.width(); ++y) {
      const float* s = &sums[static_cast<std::size_t>(v + y) * stride];
      const float* q = &squares[static_cast<std::size_t>(v + y) * stride];
      const int reach = disc.reach(y), first = middle - reach, last = middle + reach + 1, end = disc.width();
      for (int u = 0; u < places_u; ++u) {
        const auto k = static_cast<std::size_t>(u);
        whole[k] += s[u + end] - s[u];
        square[k] += q[u + end] - q[u];
        if (reach >= 0) inside[k] += s[u + last] - s[u + first];
      }
    }
    for (int u = 0; u < places_u; ++u) {
      const auto k = static_cast<std::size_t>(u);
      const double variance = static_cast<double>(square[k]) - static_cast<double>(whole[k]) * static_cast<double>(whole[k]) / n;
      if (variance <= 1e-3 * n) continue;  // nothing but a flat field
      coefficients[static_cast<std::size_t>(v) * static_cast<std::size_t>(places_u) + k] =
          static_cast<float>((static_cast<double>(inside[k]) - part * static_cast<double>(whole[k])) / std::sqrt(variance * spread));
    }
  }
}

double cubic_peak(const std::array<double, 4>& y) noexcept {
  // Newton's form about y[1], then powers: y = y1 + b x + c x^2 + d x^3 through x = -1, 0, 1, 2.
  const double d = (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]) / 6.0;
  const double c = 0.5 * (y[2] + y[0]) - y[1];
  const double b = 0.5 * (y[2] - y[0]) - d;
  double x = 0.0;
  const double root = c * c - 3.0 * b * d;
  if (root < 0.0) return y[2] > y[1] ? 1.0 : 0.0;
  // The maximum: 2 c + 6 d x < 0 there, that is x = (-c - sqrt) / (3 d), written so that d may vanish.
  const double denominator = -c + std::sqrt(root);
  if (denominator > 0.0) x = b / denominator;
  return std::clamp(x, -1.0, 2.0);
}

Located locate_by_correlation(const optics::Frame& frame, const Gains& gains, const Place& start, const Disc& disc, int neighbourhood_px,
                              Scratch& scratch) {
  Located out;
  out.radius_px = disc.radius_px();
  const int side = std::max(neighbourhood_px, disc.width() + 6) | 1;
  const int kernel = 2 * static_cast<int>(std::ceil(hole_part * disc.radius_px())) + 1;
  const int border = kernel;  // an opening reaches twice half its kernel
  const int whole = side + 2 * border;
  const int places = side - disc.width() + 1;
  static thread_local cv::Mat element;
  if (element.rows != kernel) element = cv::getStructuringElement(cv::MORPH_ELLIPSE, {kernel, kernel});
  int u = static_cast<int>(std::lround(start.u_px)), v = static_cast<int>(std::lround(start.v_px));
  for (int k = 0; k < most_recentred; ++k) {
    if (u < 0 || v < 0 || u >= frame.width_px || v >= frame.height_px) return out;
    Window& window = scratch.window;
    take_window(frame, Grey::Least, gains, u - whole / 2, v - whole / 2, whole, whole, window);
    scratch.bytes.resize(window.level.size());
    scratch.opened.resize(window.level.size());
    for (std::size_t i = 0; i < window.level.size(); ++i)
      scratch.bytes[i] = static_cast<unsigned char>(window.level[i] + 0.5F);  // NOLINT(bugprone-incorrect-roundings): none is negative
    const cv::Mat levels(whole, whole, CV_8U, scratch.bytes.data());
    cv::Mat opened(whole, whole, CV_8U, scratch.opened.data());
    cv::morphologyEx(levels, opened, cv::MORPH_OPEN, element);
    window.level.resize(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        window.level[static_cast<std::size_t>(y) * static_cast<std::size_t>(side) + static_cast<std::size_t>(x)] =
            static_cast<float>(255 - opened.at<unsigned char>(y + border, x + border));
    correlate(window.level, side, side, disc, scratch.sums, scratch.squares, scratch.coefficients);
    const auto peak = std::ranges::max_element(scratch.coefficients);
    const auto at = static_cast<int>(peak - scratch.coefficients.begin());
    const int pu = at % places, pv = at / places;
    const int du = pu - places / 2, dv = pv - places / 2;
    out.score = static_cast<double>(*peak);
    if (out.score < least_correlation) return out;
    u += du;
    v += dv;
    if (std::abs(du) > 1 || std::abs(dv) > 1 || pu < 2 || pv < 2 || pu > places - 3 || pv > places - 3) continue;
    const auto c = [&](int x, int y) {
      return static_cast<double>(
          scratch.coefficients[static_cast<std::size_t>(y) * static_cast<std::size_t>(places) + static_cast<std::size_t>(x)]);
    };
    // Four values of which the two in the middle are the greatest.
    const auto along = [&](auto value) {
      const bool right = value(1) >= value(-1);
      const double x =
          right ? cubic_peak({value(-1), value(0), value(1), value(2)}) : -cubic_peak({value(1), value(0), value(-1), value(-2)});
      return x;
    };
    out.u_px = u + along([&](int x) { return c(pu + x, pv); });
    out.v_px = v + along([&](int y) { return c(pu, pv + y); });
    const double n = static_cast<double>(disc.width()) * disc.width();
    const double left = std::max(0.0, 1.0 - out.score * out.score) / (n * out.score);
    const double uu = 2.0 * c(pu, pv) - c(pu - 1, pv) - c(pu + 1, pv), vv = 2.0 * c(pu, pv) - c(pu, pv - 1) - c(pu, pv + 1);
    out.covariance = {left / std::max(uu, 1e-6), 0.0, left / std::max(vv, 1e-6)};
    out.found = true;
    return out;
  }
  return out;
}

}  // namespace trocar::tracking
