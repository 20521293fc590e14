#include "host/camera/calibrate.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "common/config/user_error.hpp"

namespace trocar::camera {
namespace {

using Points = std::vector<cv::Point2f>;

// Mirrored about the vertical middle, about the horizontal middle, or both: turned by 180 degrees.
struct Turn {
  const char* name;
  bool across, down;
};
constexpr std::array<Turn, 3> turns{
    {{"mirrored left to right", true, false}, {"mirrored upside down", false, true}, {"turned by 180 degrees", true, true}}};
// How much the squared residuals over their variance must fall when a view is turned back: it is then e^10 times likelier. On the
// photographs of the tests a good view rises, by 1 to 200; a turned one falls by 20 to 1200.
constexpr double turned_evidence = 20.0;

// OpenCV solves its small systems with whatever LAPACK is installed. OpenBLAS's threads wait for each other longer than such a system
// takes: on a busy machine 35 s instead of 1.4.
void keep_openblas_to_one_thread() {
  if (void* const found = ::dlsym(RTLD_DEFAULT, "openblas_set_num_threads"); found != nullptr) reinterpret_cast<void (*)(int)>(found)(1);
}

struct Solution {
  double rms_px{};
  optics::Lens lens{}, deviation{};
  cv::Mat matrix{}, distortion{};
  std::vector<cv::Mat> rotation{}, translation{};  // of the views fitted, in order
  std::vector<double> view_rms_px{};
};

std::vector<cv::Point3f> board_points(const Board& board) {
  std::vector<cv::Point3f> points;
  for (int j = 0; j < board.rows; ++j)
    for (int i = 0; i < board.columns; ++i)
      points.emplace_back(static_cast<float>(i * board.square_m), static_cast<float>(j * board.square_m), 0.0F);
  return points;
}

Points points_of(const View& view) {
  Points points;
  for (const optics::Pixel& p : view.corners.pixel) points.emplace_back(static_cast<float>(p.u_px), static_cast<float>(p.v_px));
  return points;
}

struct Correspondences {
  std::vector<std::vector<cv::Point3f>> objects{};
  std::vector<Points> images{};
};

Correspondences correspondences(const std::vector<View>& views, const std::vector<std::size_t>& used, const Board& board) {
  Correspondences c;
  c.objects.assign(used.size(), board_points(board));
  for (const std::size_t k : used) c.images.push_back(points_of(views[k]));
  return c;
}

int flags_of(const FitOptions& options) {
  int flags = options.fixed_aspect ? cv::CALIB_FIX_ASPECT_RATIO : 0;
  if (!options.tangential) flags |= cv::CALIB_ZERO_TANGENT_DIST;
  if (options.radial_terms < 1) flags |= cv::CALIB_FIX_K1;
  if (options.radial_terms < 2) flags |= cv::CALIB_FIX_K2;
  if (options.radial_terms < 3) flags |= cv::CALIB_FIX_K3;
  return flags;
}

std::size_t parameters_of(const FitOptions& options, std::size_t views) {
  return (options.fixed_aspect ? 3U : 4U) + static_cast<std::size_t>(options.radial_terms) + (options.tangential ? 2U : 0U) + 6U * views;
}

// How to have better views.
constexpr const char* better_views =
    "take 10 to 20 in which the board is tilted by 20 to 40 degrees in different directions and reaches into every corner of the image";

Solution solve(const std::vector<View>& views, const std::vector<std::size_t>& used, const cv::Size& size, const Board& board,
               const FitOptions& options) {
  const auto [objects, images] = correspondences(views, used, board);
  const std::size_t corners = used.size() * board.corners();
  const std::size_t parameters = parameters_of(options, used.size());
  if (corners <= parameters)
    throw config::UserError(
        fmt::format("{} corners in {} views do not determine {} numbers; {}", corners, used.size(), parameters, better_views));
  Solution s;
  s.matrix = cv::Mat::eye(3, 3, CV_64F);
  s.distortion = cv::Mat::zeros(1, 5, CV_64F);
  cv::Mat deviation, pose_deviation, view_rms;
  keep_openblas_to_one_thread();
  s.rms_px = cv::calibrateCamera(objects, images, size, s.matrix, s.distortion, s.rotation, s.translation, deviation, pose_deviation,
                                 view_rms, flags_of(options), {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-12});
  // OpenCV takes the noise as squared residuals over (corners - parameters); two numbers come from each corner.
  const double per_number = std::sqrt(static_cast<double>(corners - parameters) / static_cast<double>(2 * corners - parameters));
  const auto value = [](const cv::Mat& of, int k) { return of.at<double>(k); };
  s.lens = {value(s.matrix, 0), value(s.matrix, 4), value(s.matrix, 2), value(s.matrix, 5), {}};
  s.deviation = {per_number * value(deviation, 0),
                 per_number * value(deviation, 1),
                 per_number * value(deviation, 2),
                 per_number * value(deviation, 3),
                 {}};
  if (options.fixed_aspect) s.deviation.fx_px = s.deviation.fy_px;  // one number, kept as fy
  for (int k = 0; k < 5; ++k) {
    s.lens.distortion[static_cast<std::size_t>(k)] = value(s.distortion, k);
    s.deviation.distortion[static_cast<std::size_t>(k)] = per_number * value(deviation, 4 + k);
  }
  for (int k = 0; k < static_cast<int>(used.size()); ++k) s.view_rms_px.push_back(value(view_rms, k));
  if (!std::isfinite(s.rms_px) || !std::isfinite(s.lens.fx_px) || !(s.lens.fx_px > 0.0) || !std::isfinite(s.deviation.fy_px))
    throw config::UserError(fmt::format("{} views do not determine the lens; {}", used.size(), better_views));
  return s;
}

// OpenCV inverts the normal matrix by its pseudo-inverse, which hides a direction that nothing determines. Boards that are all parallel
// leave one: focal length against distance. So: does a focal length that is wrong by a tenth fit worse, by more than noise (three standard
// deviations)?
void require_focal_length(const std::vector<View>& views, const std::vector<std::size_t>& used, const cv::Size& size, const Board& board,
                          const FitOptions& options, const Solution& s) {
  const auto [objects, images] = correspondences(views, used, board);
  cv::Mat matrix = s.matrix.clone(), distortion = s.distortion.clone();
  matrix.at<double>(0, 0) *= 1.1;
  matrix.at<double>(1, 1) *= 1.1;
  const double rms = cv::calibrateCamera(objects, images, size, matrix, distortion, cv::noArray(), cv::noArray(),
                                         flags_of(options) | cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_FOCAL_LENGTH,
                                         {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-12});
  const auto corners = static_cast<double>(used.size() * board.corners());
  const double variance = corners * s.rms_px * s.rms_px / (2.0 * corners - static_cast<double>(parameters_of(options, used.size())));
  if (!(corners * (rms * rms - s.rms_px * s.rms_px) > 9.0 * variance))
    throw config::UserError(fmt::format("{} views do not determine the lens: a focal length of {:.5g} px fits as well as {:.5g} px; {}",
                                        used.size(), matrix.at<double>(0, 0), s.lens.fx_px, better_views));
}

// Sum of squared residuals of the best pose.
double square_of(const std::vector<cv::Point3f>& object, const Points& image, const Solution& s) {
  cv::Mat rotation, translation;
  if (!cv::solvePnP(object, image, s.matrix, s.distortion, rotation, translation)) return std::numeric_limits<double>::infinity();
  Points fitted;
  cv::projectPoints(object, rotation, translation, s.matrix, s.distortion, fitted);
  return cv::norm(image, fitted, cv::NORM_L2SQR);
}

// The view as it was before the frame was turned, its order right-handed again.
Points turned(const Points& image, const Board& board, const cv::Size& size, const Turn& turn) {
  Points back = image;
  for (cv::Point2f& p : back) {
    if (turn.across) p.x = static_cast<float>(size.width - 1) - p.x;
    if (turn.down) p.y = static_cast<float>(size.height - 1) - p.y;
  }
  if (turn.across != turn.down)
    for (auto row = back.begin(); row != back.end(); row += board.columns) std::reverse(row, row + board.columns);
  return back;
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

struct Suspect {
  std::size_t at{};  // in `used`
  double evidence{};
  const char* turn{};
};

Suspect most_turned(const std::vector<View>& views, const std::vector<std::size_t>& used, const cv::Size& size, const Board& board,
                    const Solution& s) {
  const std::vector<cv::Point3f> object = board_points(board);
  constexpr double best_px = 0.02;  // no corner is found better; without noise nothing would be left to compare with
  const double noise_px = std::max(best_px, median_of(s.view_rms_px));
  const double variance = 0.5 * noise_px * noise_px;  // of a component
  Suspect worst;
  for (std::size_t k = 0; k < used.size(); ++k) {
    const Points image = points_of(views[used[k]]);
    const double as_is = static_cast<double>(image.size()) * s.view_rms_px[k] * s.view_rms_px[k];
    for (const Turn& turn : turns) {
      const double evidence = (as_is - square_of(object, turned(image, board, size, turn), s)) / variance;
      if (evidence > worst.evidence) worst = {k, evidence, turn.name};
    }
  }
  return worst;
}

bool left_handed(const View& view, const Board& board) {
  const std::vector<optics::Pixel>& p = view.corners.pixel;
  const optics::Pixel& origin = p.front();
  const optics::Pixel& across = p[static_cast<std::size_t>(board.columns - 1)];
  const optics::Pixel& down = p[p.size() - static_cast<std::size_t>(board.columns)];
  return (across.u_px - origin.u_px) * (down.v_px - origin.v_px) < (across.v_px - origin.v_px) * (down.u_px - origin.u_px);
}

void require_enough(const std::vector<std::string>& left_out, const std::vector<View>& views, std::size_t used) {
  if (used >= least_views) return;
  constexpr std::size_t most_named = 3;
  std::string reasons;
  std::size_t gaps = 0;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (left_out[k].empty()) continue;
    if (++gaps <= most_named) reasons += fmt::format("{}{}: {}", gaps > 1 ? "; " : "", views[k].file, left_out[k]);
  }
  if (gaps > most_named) reasons += fmt::format("; and {} more", gaps - most_named);
  throw config::UserError(fmt::format("{} of {} images show the board, at least {} must{}{}; {}", used, views.size(), least_views,
                                      reasons.empty() ? "" : ": ", reasons, better_views));
}

}  // namespace

double median_rms_px(const optics::Calibration& calibration) {
  std::vector<double> rms;
  for (const optics::CalibratedView& view : calibration.views)
    if (view.pose) rms.push_back(view.pose->rms_px);
  return median_of(std::move(rms));
}

Fit calibrate(const std::vector<View>& views, int width_px, int height_px, const Board& board, const FitOptions& options) try {
  const cv::Size size(width_px, height_px);
  std::vector<std::string> left_out(views.size());
  std::vector<std::size_t> used;
  for (std::size_t k = 0; k < views.size(); ++k) {
    left_out[k] = views[k].corners.problem;
    if (left_out[k].empty() && left_handed(views[k], board)) left_out[k] = "mirrored: its corners are numbered left-handed";
    if (left_out[k].empty()) used.push_back(k);
  }
  require_enough(left_out, views, used.size());
  Solution s = solve(views, used, size, board, options);
  const auto leave_out = [&](std::size_t at, std::string reason) {
    left_out[used[at]] = std::move(reason);
    used.erase(used.begin() + static_cast<std::ptrdiff_t>(at));
    require_enough(left_out, views, used.size());
    s = solve(views, used, size, board, options);
  };
  for (Suspect w = most_turned(views, used, size, board, s); w.evidence > turned_evidence; w = most_turned(views, used, size, board, s))
    leave_out(w.at, fmt::format("the frame is {}: its corners fit better when turned back; save frames as the camera gives them", w.turn));
  const auto is_outlier = [&](double rms) { return rms > outlier_factor * median_of(s.view_rms_px); };
  while (options.without_outliers) {
    const auto worst = std::max_element(s.view_rms_px.begin(), s.view_rms_px.end());
    if (!is_outlier(*worst)) break;
    leave_out(static_cast<std::size_t>(worst - s.view_rms_px.begin()),
              fmt::format("outlier: RMS {:.3f} px, {:.1f} times the median of the views", *worst, *worst / median_of(s.view_rms_px)));
  }

  require_focal_length(views, used, size, board, options, s);

  Fit fit;
  fit.camera = {width_px, height_px, s.lens, optics::Calibration{}};
  optics::Calibration& c = *fit.camera.calibration;
  c.rms_px = s.rms_px;
  c.fixed_aspect = options.fixed_aspect;
  c.columns = board.columns;
  c.rows = board.rows;
  c.square_m = board.square_m;
  c.standard_deviation = s.deviation;
  for (std::size_t k = 0; k < views.size(); ++k) c.views.push_back({.file = views[k].file, .left_out = left_out[k]});
  const std::vector<cv::Point3f> object = board_points(board);
  for (std::size_t k = 0; k < used.size(); ++k) {
    optics::CalibratedView& view = c.views[used[k]];
    optics::BoardPose pose{.rms_px = s.view_rms_px[k]};
    for (int a = 0; a < 3; ++a) {
      pose.rotation_rad[static_cast<std::size_t>(a)] = s.rotation[k].at<double>(a);
      pose.translation_m[static_cast<std::size_t>(a)] = s.translation[k].at<double>(a);
    }
    view.pose = pose;
    view.outlier = is_outlier(pose.rms_px);
    Points fitted;
    cv::projectPoints(object, s.rotation[k], s.translation[k], s.matrix, s.distortion, fitted);
    for (std::size_t i = 0; i < fitted.size(); ++i) {
      const optics::Pixel& at = views[used[k]].corners.pixel[i];
      fit.residuals.push_back({at, at.u_px - static_cast<double>(fitted[i].x), at.v_px - static_cast<double>(fitted[i].y), view.outlier});
    }
  }
  return fit;
} catch (const cv::Exception&) {  // the closed form has no solution
  throw config::UserError(fmt::format("the views do not determine the lens; {}", better_views));
}

}  // namespace trocar::camera
