#include "host/tracking/picture.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace trocar::tracking {

bool draw_markers(const optics::Frame& frame, std::span<const Place> rest, std::span<const Marker> markers, double scale,
                  const std::filesystem::path& file) {
  // OpenCV writes through no pointer to const data; what is drawn on is a copy.
  const int type = frame.format == optics::PixelFormat::Rgb8 ? CV_8UC3 : CV_8UC1;
  const cv::Mat seen(frame.height_px, frame.width_px, type, const_cast<std::uint8_t*>(frame.pixels.data()));  // NOLINT
  cv::Mat image;
  switch (frame.format) {
    case optics::PixelFormat::Mono8:
      cv::cvtColor(seen, image, cv::COLOR_GRAY2BGR);
      break;
    case optics::PixelFormat::Rgb8:
      cv::cvtColor(seen, image, cv::COLOR_RGB2BGR);
      break;
    case optics::PixelFormat::BayerRG8:
      cv::cvtColor(seen, image, cv::COLOR_BayerBG2BGR);  // OpenCV names a pattern after its second row
      break;
  }
  const int thick = std::max(1, frame.width_px / 1000), arm = std::max(3, frame.width_px / 250);
  const cv::Scalar green(60, 200, 60), orange(0, 120, 255);
  constexpr int shift = 4;  // OpenCV draws at sixteenths of a pixel
  const auto point = [](double u, double v) {
    return cv::Point(static_cast<int>(std::lround(u * (1 << shift))), static_cast<int>(std::lround(v * (1 << shift))));
  };
  for (std::size_t k = 0; k < markers.size(); ++k) {
    const Marker& m = markers[k];
    if (!m.valid) continue;
    cv::line(image, point(m.u_px - arm, m.v_px), point(m.u_px + arm, m.v_px), green, thick, cv::LINE_AA, shift);
    cv::line(image, point(m.u_px, m.v_px - arm), point(m.u_px, m.v_px + arm), green, thick, cv::LINE_AA, shift);
    const double du = m.u_px - rest[k].u_px, dv = m.v_px - rest[k].v_px, length = scale * std::hypot(du, dv);
    if (!(std::hypot(du, dv) > 1.0)) continue;
    const cv::Point from = point(rest[k].u_px, rest[k].v_px), to = point(rest[k].u_px + scale * du, rest[k].v_px + scale * dv);
    cv::line(image, from, to, orange, thick + 1, cv::LINE_AA, shift);
    // The head, in the arrow's own frame.
    const double head = std::min(0.4 * length, 3.0 * arm), c = du / std::hypot(du, dv), s = dv / std::hypot(du, dv);
    for (const double side : {-0.4, 0.4})
      cv::line(image, to, point(rest[k].u_px + scale * du - head * (c - side * s), rest[k].v_px + scale * dv - head * (s + side * c)),
               orange, thick + 1, cv::LINE_AA, shift);
  }
  try {
    return cv::imwrite(file.string(), image);
  } catch (const cv::Exception&) {
    return false;
  }
}

}  // namespace trocar::tracking
