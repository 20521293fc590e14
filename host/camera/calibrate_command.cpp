#include "host/camera/calibrate_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <ctime>
#include <set>

#include "common/config/new_file.hpp"
#include "common/config/quote.hpp"
#include "common/config/user_error.hpp"
#include "host/camera/image.hpp"
#include "host/camera/picture.hpp"

namespace trocar::camera {
namespace {

std::string now_utc() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  (void)std::strftime(text.data(), text.size(), "%FT%TZ", &utc);
  return text.data();
}

void refuse_twice(const std::vector<std::filesystem::path>& images) {
  std::set<std::filesystem::path> seen;
  for (const auto& file : images) {
    std::error_code ignored;
    if (!seen.insert(std::filesystem::weakly_canonical(file, ignored)).second)
      throw config::UserError(fmt::format("{}: given twice; a view counts once", file.string()));
  }
}

struct Views {
  std::vector<View> view{};
  cv::Size size{};
};

Views find_views(const CalibrateOptions& options, const std::atomic<bool>& stop) {
  const bool show = isatty(STDERR_FILENO) == 1;
  Views found;
  std::string first;
  for (std::size_t k = 0; k < options.images.size(); ++k) {
    if (stop.load()) throw config::UserError("stopped; nothing was written");
    const std::filesystem::path& file = options.images[k];
    if (show) fmt::print(stderr, "\r{} of {}: {} \x1b[K", k + 1, options.images.size(), file.string());
    View view{file.string(), {}};
    try {
      const cv::Mat grey = read_image(file, Colour::Grey);
      if (first.empty()) {
        first = file.string();
        found.size = grey.size();
      }
      if (grey.size() != found.size)
        throw config::UserError(
            fmt::format("{}: {} x {} px, but {} is {} x {} px; a calibration holds for one size, leave out the images of the other",
                        file.string(), grey.cols, grey.rows, first, found.size.width, found.size.height));
      view.corners = find_corners(grey, options.board, options.window);
    } catch (const DamagedImage& e) {
      view.corners.problem = e.what();
    }
    found.view.push_back(std::move(view));
  }
  if (show) fmt::print(stderr, "\r\x1b[K");
  return found;
}

// In how much of the image no ray can be given to a pixel.
double not_invertible(const optics::Camera& camera) {
  const optics::Rectifier rectifier(camera.lens);
  constexpr int steps = 40;
  int bad = 0;
  for (int j = 0; j <= steps; ++j)
    for (int i = 0; i <= steps; ++i)
      if (rectifier.newton({(camera.width_px - 1.0) * i / steps, (camera.height_px - 1.0) * j / steps}).status != optics::Status::Ok) ++bad;
  return static_cast<double>(bad) / ((steps + 1) * (steps + 1));
}

void warn(const Fit& fit, const Views& views, const CalibrateOptions& options) {
  const optics::Calibration& c = *fit.camera.calibration;
  for (std::size_t k = 0; k < c.views.size(); ++k) {
    const optics::CalibratedView& view = c.views[k];
    if (!view.left_out.empty()) fmt::print(stderr, "trocar: {}: left out: {}\n", view.file, view.left_out);
    if (!view.outlier) continue;
    std::string text = fmt::format("trocar: {}: outlier: RMS {:.3f} px, {:.1f} times the median of the views (limit {:g})", view.file,
                                   view.pose->rms_px, view.pose->rms_px / median_rms_px(c), outlier_factor);
    const double closest = views.view[k].corners.closest_px;
    if (!options.window.by_spacing && closest < 2.0 * options.window.half_px)
      text += fmt::format(
          "; its corners are {:.1f} px apart and the window reaches {} px to each side, over the neighbours' edges: try --window spacing",
          closest, options.window.half_px);
    else
      text += "; look at it, or use --without-outliers";
    fmt::print(stderr, "{}\n", text);
  }
  if (const double part = not_invertible(fit.camera); part > 0.0)
    fmt::print(stderr,
               "trocar: the lens folds within {:.1f} % of the image, where no board was; show the board there, or use --radial 2 or 1\n",
               100 * part);
}

std::string json_of(const Fit& fit) {
  const optics::Camera& camera = fit.camera;
  const optics::Calibration& c = *camera.calibration;
  const auto lens = [](const optics::Lens& l) {
    return fmt::format("\"fx_px\": {}, \"fy_px\": {}, \"cx_px\": {}, \"cy_px\": {}, \"distortion\": [{}]", l.fx_px, l.fy_px, l.cx_px,
                       l.cy_px, fmt::join(l.distortion, ", "));
  };
  std::string views, left_out, outliers;
  std::size_t used = 0;
  const auto comma = [](const std::string& list) { return list.empty() ? "" : ", "; };
  for (const optics::CalibratedView& v : c.views) {
    const std::string name = config::quote(v.file);
    if (!v.left_out.empty()) {
      left_out += fmt::format("{}{{\"file\": {}, \"reason\": {}}}", comma(left_out), name, config::quote(v.left_out));
      continue;
    }
    ++used;
    views +=
        fmt::format("{}{{\"file\": {}, \"rms_px\": {}, \"outlier\": {}, \"rotation_rad\": [{}], \"translation_m\": [{}]}}", comma(views),
                    name, v.pose->rms_px, v.outlier, fmt::join(v.pose->rotation_rad, ", "), fmt::join(v.pose->translation_m, ", "));
    if (v.outlier) outliers += comma(outliers) + name;
  }
  return fmt::format(
      "{{\"rms_px\": {}, {}, \"standard_deviation\": {{{}}}, \"fixed_aspect\": {}, \"width_px\": {}, \"height_px\": {}, \"images\": {}, "
      "\"views_used\": {}, \"views\": [{}], \"outliers\": [{}], \"left_out\": [{}], \"not_invertible\": {:.4g}}}",
      c.rms_px, lens(camera.lens), lens(c.standard_deviation), c.fixed_aspect, camera.width_px, camera.height_px, c.views.size(), used,
      views, outliers, left_out, not_invertible(camera));
}

std::string text_of(const Fit& fit) {
  const optics::Lens& l = fit.camera.lens;
  const optics::Calibration& c = *fit.camera.calibration;
  const optics::Lens& d = c.standard_deviation;
  std::string text = fmt::format(
      "RMS {:.4f} px over {} corners\nfx {:.3f} ± {:.3f} px{}\nfy {:.3f} ± {:.3f} px\ncx {:.3f} ± {:.3f} px\ncy {:.3f} ± {:.3f} px\n",
      c.rms_px, fit.residuals.size(), l.fx_px, d.fx_px, c.fixed_aspect ? " (fx = fy)" : "", l.fy_px, d.fy_px, l.cx_px, d.cx_px, l.cy_px,
      d.cy_px);
  constexpr std::array<const char*, 5> names{"k1", "k2", "p1", "p2", "k3"};
  for (std::size_t k = 0; k < 5; ++k)
    if (d.distortion[k] > 0.0) text += fmt::format("{} {:.6f} ± {:.6f}\n", names[k], l.distortion[k], d.distortion[k]);
  for (const optics::CalibratedView& v : c.views)
    if (v.left_out.empty()) text += fmt::format("{} RMS {:.3f} px{}\n", v.file, v.pose->rms_px, v.outlier ? ", outlier" : "");
  return text;
}

}  // namespace

std::string parse_board(const std::string& text, Board& board) {
  constexpr int most = 100;
  const auto wrong = [&] { return fmt::format("{}: write COLUMNSxROWS of inner corners, each 3 to {}, such as 9x6", text, most); };
  const char* const end = text.data() + text.size();
  const auto [x, first] = std::from_chars(text.data(), end, board.columns);
  if (first != std::errc() || x == end || *x != 'x') return wrong();
  const auto [last, second] = std::from_chars(x + 1, end, board.rows);
  if (second != std::errc() || last != end) return wrong();
  if (std::min(board.columns, board.rows) < 3 || std::max(board.columns, board.rows) > most) return wrong();
  return {};
}

int run_calibrate(const CalibrateOptions& options, const std::atomic<bool>& stop) {
  refuse_twice(options.images);
  config::NewFile file(options.out);
  const std::filesystem::path picture_name =
      options.picture.empty() ? std::filesystem::path(options.out).replace_extension(".svg") : options.picture;
  if (picture_name == options.out)
    throw config::UserError(fmt::format("{}: camera file and picture cannot be one; give --picture", options.out.string()));
  config::NewFile picture(picture_name);
  const Views views = find_views(options, stop);
  Fit fit = calibrate(views.view, views.size.width, views.size.height, options.board, options.fit);
  fit.camera.calibration->date = now_utc();
  optics::write_camera(file.stream(), fit.camera);
  draw_residuals(picture.stream(), fit);
  if (stop.load()) throw config::UserError("stopped; nothing was written");
  picture.keep();
  file.keep();
  warn(fit, views, options);
  if (options.json)
    fmt::print("{}\n", json_of(fit));
  else
    fmt::print("{}{} and {} written\n", text_of(fit), options.out.string(), picture_name.string());
  return 0;
}

}  // namespace trocar::camera
