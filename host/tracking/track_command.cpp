#include "host/tracking/track_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/config/new_file.hpp"
#include "common/config/quote.hpp"
#include "common/config/user_error.hpp"
#include "common/optics/pose_file.hpp"
#include "host/tracking/picture.hpp"
#include "host/tracking/plane_pose.hpp"
#include "host/tracking/publish.hpp"

namespace trocar::tracking {
namespace {

using Timer = std::chrono::steady_clock;

constexpr std::chrono::milliseconds look_up{200};  // for the end that the user asks for
constexpr double grid_patience_s = 30.0;           // of a live camera, until it shows the grid

// A table that grows by whole frames, each on the disk before the next.
class Table {
 public:
  Table(std::filesystem::path path, const char* header) : path_(std::move(path)) {
    if (path_.empty()) return;
    errno = 0;
    file_.open(path_, std::ios::binary | std::ios::trunc);
    if (!file_)
      throw config::UserError(
          fmt::format("{}: cannot be written: {}; name a file in a folder that is yours", path_.string(), std::strerror(errno)));
    text_ = header;
    put();
  }
  [[nodiscard]] bool wanted() const { return file_.is_open(); }
  [[nodiscard]] std::string& text() { return text_; }
  void put() {
    if (!wanted()) return;
    file_ << text_ << std::flush;
    text_.clear();
    if (!file_) throw config::UserError(fmt::format("{}: not everything could be written: is the disk full?", path_.string()));
  }

 private:
  std::filesystem::path path_;
  std::ofstream file_{};
  std::string text_{};
};

struct Files {
  Table markers, covariance;
};

void append(Files& files, const optics::MarkerGrid& grid, const TrackedFrame& f, double t_s) {
  auto out = std::back_inserter(files.markers.text());
  auto spread = std::back_inserter(files.covariance.text());
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const std::size_t k = grid.index(row, column);
      const Marker& m = f.markers[k];
      const MetricMarker& p = f.metric[k];
      fmt::format_to(out, "{},{},{},{},{},{},{},{},{:.4f},{}\n", f.number, t_s, row, column, m.u_px, m.v_px, p.x_m, p.y_m, m.score,
                     m.valid ? 1 : 0);
      if (files.covariance.wanted())
        fmt::format_to(spread, "{},{},{},{:.6g},{:.6g},{:.6g}\n", f.number, row, column, p.covariance[0], p.covariance[1], p.covariance[2]);
    }
  }
  files.markers.put();
  files.covariance.put();
}

// Places of all markers between four corners, straight lines of the plane kept straight: in rectified pixels.
std::vector<Place> between_corners(const std::vector<double>& corner, const optics::MarkerGrid& grid, const optics::Lens& lens) {
  double area = 0.0;  // twice, negative when they go round against the clock as one sees the image
  for (std::size_t k = 0; k < 8; k += 2) {
    const std::size_t n = (k + 2) % 8;
    area += corner[k] * corner[n + 1] - corner[n] * corner[k + 1];
  }
  if (!(area < 0.0))
    throw config::UserError(
        "--corners: they go round with the clock, so that the phantom would be seen from behind; give row 0 column 0, row 0 last column, "
        "both last, last row column 0");
  const optics::Rectifier rectifier(lens);
  const auto last_column = static_cast<float>(grid.columns - 1), last_row = static_cast<float>(grid.rows - 1);
  const std::vector<cv::Point2f> cells{{0.0F, 0.0F}, {last_column, 0.0F}, {last_column, last_row}, {0.0F, last_row}};
  std::vector<cv::Point2f> rectified;
  for (std::size_t k = 0; k < 8; k += 2) {
    const optics::Mapped m = rectifier.newton({corner[k], corner[k + 1]});
    if (m.status != optics::Status::Ok)
      throw config::UserError(
          fmt::format("--corners {},{}: the lens sees nothing there; give a place in the image", corner[k], corner[k + 1]));
    rectified.emplace_back(static_cast<float>(m.pixel.u_px), static_cast<float>(m.pixel.v_px));
  }
  const cv::Matx33d h = cv::getPerspectiveTransform(cells, rectified);
  std::vector<Place> places;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const cv::Vec3d p = h * cv::Vec3d(column, row, 1.0);
      const optics::Mapped m = rectifier.distort({p[0] / p[2], p[1] / p[2]});
      places.push_back({m.pixel.u_px, m.pixel.v_px});
    }
  }
  return places;
}

double percentile(std::vector<double> values, double part) {
  if (values.empty()) return std::nan("");
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(part * static_cast<double>(values.size())))];
}

class Run {
 public:
  explicit Run(const TrackOptions& options) : options_(options), camera_(optics::read_camera(options.camera)), tracker_(options.tracker) {
    if (!options.pose.empty()) view_.emplace(camera_.lens, optics::read_pose(options.pose));
    source_ = camera::open_source(options.source, options.source_options);
    if (options.source_options.domain) publisher_.emplace(*options.source_options.domain, options.tracker.grid);
    begun_ = Timer::now();
  }

  int run(const std::atomic<bool>& stop) {
    optics::Frame frame;
    while (!stop.load()) {
      const auto status = source_->next(frame, look_up);
      for (const std::string& line : source_->notices()) fmt::print(stderr, "trocar: {}\n", line);
      if (status == camera::Source::Status::Timeout) continue;
      if (status == camera::Source::Status::End) break;
      if (status == camera::Source::Status::Lost) {
        fmt::print(stderr, "trocar: {}\n", source_->what());
        return finish(1);
      }
      take(frame);
    }
    return finish(0);
  }

 private:
  void take(const optics::Frame& frame) {
    if (frame.width_px != camera_.width_px || frame.height_px != camera_.height_px)
      throw config::UserError(fmt::format("{}: frame {} has {} x {} px, the camera in {} {} x {}; name the camera that took it",
                                          source_->what(), frame.number, frame.width_px, frame.height_px, options_.camera.string(),
                                          camera_.width_px, camera_.height_px));
    const auto before = Timer::now();
    if (!started_) {
      if (!start(frame)) return;
    } else {
      tracker_.update(frame);
    }
    metric_.clear();
    for (const Marker& m : tracker_.markers()) metric_.push_back(to_plane(*view_, m));
    const double ms = std::chrono::duration<double, std::milli>(Timer::now() - before).count();
    if (frames_ > 0) ms_.push_back(ms);  // the first finds the grid
    ++frames_;
    const std::size_t valid = tracker_.valid();
    lost_markers_ += tracker_.markers().size() - valid;
    if (valid < fewest_) fewest_ = valid;
    if (valid == 0) {
      if (!dark_) fmt::print(stderr, "trocar: frame {}: no marker is seen; they are sought in every frame\n", frame.number);
      dark_ = true;
    } else {
      dark_ = false;
    }
    const TrackedFrame tracked{frame.number,       frame.time_ns, frame.time_uncertainty_ns, source_->clock(),
                               tracker_.markers(), metric_,       source_->counters(),       ms};
    const bool own_zero = source_->clock() == camera::Clock::Camera || source_->clock() == camera::Clock::Host;
    const std::int64_t zero = own_zero ? first_ns_ : 0;
    uncertainty_ns_ = std::max(uncertainty_ns_, frame.time_uncertainty_ns);
    append(*files_, options_.tracker.grid, tracked, 1e-9 * static_cast<double>(frame.time_ns - zero));
    if (publisher_) publisher_->publish(tracked);
    keep_if_moved_most(frame);
  }

  // False: not yet, and that is no error.
  bool start(const optics::Frame& frame) {
    std::string problem;
    if (options_.corners_px.empty()) {
      problem = tracker_.start(frame);
    } else {
      const auto places = between_corners(options_.corners_px, options_.tracker.grid, camera_.lens);
      const auto& g = options_.tracker.grid;
      const double step = places.size() > 1 ? std::hypot(places[1].u_px - places[0].u_px, places[1].v_px - places[0].v_px) : 60.0;
      const double part = options_.known_diameter ? g.diameter_m / g.spacing_m : 1.0 / 3.0;
      problem = tracker_.start(frame, places, 0.5 * part * step);
    }
    if (!problem.empty()) {
      if (options_.live && std::chrono::duration<double>(Timer::now() - begun_).count() < grid_patience_s) return false;
      throw config::UserError(fmt::format("{}: frame {}: {}", source_->what(), frame.number, problem));
    }
    if (!view_) {
      const auto fit = fit_plane(camera_.lens, options_.tracker.grid, tracker_.markers());
      if (!fit)
        throw config::UserError(
            fmt::format("{}: frame {}: the markers do not determine the plane; give its pose with --pose", source_->what(), frame.number));
      view_.emplace(camera_.lens, fit->pose);
      pose_rms_px_ = fit->rms_px;
    }
    files_ = std::make_unique<Files>(Files{{options_.out, "frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid\n"},
                                           {options_.covariance, "frame,row,col,xx_m2,xy_m2,yy_m2\n"}});
    if (!options_.pose_out.empty()) {
      config::NewFile file(options_.pose_out);
      optics::write_pose(file.stream(), view_->pose());
      file.keep();
    }
    first_ns_ = frame.time_ns;
    started_ = true;
    return true;
  }

  // For the picture: the frame in which the phantom is deformed most.
  void keep_if_moved_most(const optics::Frame& frame) {
    if (options_.picture.empty()) return;
    if (rest_.empty()) rest_ = tracker_.rest();
    double sum = 0.0;
    std::size_t n = 0;
    for (std::size_t k = 0; k < rest_.size(); ++k) {
      const Marker& m = tracker_.markers()[k];
      if (!m.valid || std::isnan(rest_[k].u_px)) continue;
      sum += std::hypot(m.u_px - rest_[k].u_px, m.v_px - rest_[k].v_px);
      ++n;
    }
    const double mean = n > 0 ? sum / static_cast<double>(n) : 0.0;
    if (!most_moved_.pixels.empty() && mean <= most_ * 1.02 + 0.02) return;  // not a copy for every hair's breadth
    most_ = mean;
    most_moved_ = frame;
    most_markers_.assign(tracker_.markers().begin(), tracker_.markers().end());
  }

  int finish(int code) {
    if (!started_) {
      if (code != 0) return code;
      throw config::UserError(fmt::format("{}: ended before a frame showed the grid; nothing was written", source_->what()));
    }
    if (!options_.picture.empty() && !draw_markers(most_moved_, rest_, most_markers_, options_.picture_scale, options_.picture))
      throw config::UserError(fmt::format("{}: cannot be written as an image; give a name that ends in .png, in a folder that is yours",
                                          options_.picture.string()));
    const camera::SourceCounters c = source_->counters();
    const std::size_t all = frames_ * tracker_.markers().size();
    const double p50 = percentile(ms_, 0.5), p99 = percentile(ms_, 0.99);
    if (!options_.summary.empty()) {
      config::NewFile file(options_.summary);
      file.stream() << fmt::format(
          "# What trocar track saw.\nsource = {}\nclock = \"{}\"\ntime_uncertainty_s = {:g}\nframes = {}\nframes_lost = {}\n"
          "frames_dropped = {}\nmarkers = {}\nmarkers_not_seen = {}\nfewest_markers = {}\ntrack_s_p50 = {:g}\ntrack_s_p99 = {:g}\n",
          config::quote(source_->what()), camera::to_string(source_->clock()), 1e-9 * static_cast<double>(uncertainty_ns_), frames_, c.lost,
          c.dropped, tracker_.markers().size(), lost_markers_, fewest_, 1e-3 * p50, 1e-3 * p99);
      file.keep();
    }
    if (options_.json) {
      const auto number = [](double x) { return std::isnan(x) ? std::string("null") : fmt::format("{:.6g}", x); };
      fmt::print(
          "{{\"source\": {}, \"clock\": \"{}\", \"time_uncertainty_us\": {:.3f}, \"frames\": {}, \"frames_lost\": {}, \"frames_dropped\": "
          "{}, \"markers\": {}, "
          "\"markers_not_seen\": {}, \"fewest_markers\": {}, \"radius_px\": {:.4f}, \"pose_rms_px\": {}, \"track_ms_p50\": {}, "
          "\"track_ms_p99\": {}}}\n",
          config::quote(source_->what()), camera::to_string(source_->clock()), 1e-3 * static_cast<double>(uncertainty_ns_), frames_, c.lost,
          c.dropped, tracker_.markers().size(), lost_markers_, fewest_, tracker_.radius_px(), number(pose_rms_px_), number(p50),
          number(p99));
    } else {
      fmt::print(
          "{} frames of {} markers, {} of {} places not seen; {} frames lost, {} dropped; {:.2f} ms a frame (p99 {:.2f}); times on the "
          "{}\n",
          frames_, tracker_.markers().size(), lost_markers_, all, c.lost, c.dropped, p50, p99,
          source_->clock() == camera::Clock::Rate ? "rate given" : fmt::format("{}'s clock", camera::to_string(source_->clock())));
      fmt::print("{} written\n", options_.out.string());
    }
    return code;
  }

  TrackOptions options_;
  optics::Camera camera_;
  Tracker tracker_;
  std::unique_ptr<camera::Source> source_{};
  std::optional<optics::PlaneView> view_{};
  std::unique_ptr<Files> files_{};
  std::optional<Publisher> publisher_{};
  Timer::time_point begun_{};
  bool started_{}, dark_{};
  double pose_rms_px_{std::nan("")};
  std::int64_t first_ns_{}, uncertainty_ns_{};
  std::size_t frames_{}, lost_markers_{}, fewest_{static_cast<std::size_t>(-1)};
  std::vector<double> ms_{};
  std::vector<MetricMarker> metric_{};
  std::vector<Place> rest_{};
  optics::Frame most_moved_{};
  std::vector<Marker> most_markers_{};
  double most_{};
};

}  // namespace

std::string parse_corners(const std::vector<std::string>& texts, std::vector<double>& corners_px) {
  corners_px.clear();
  for (const std::string& text : texts) {
    const std::size_t comma = text.find(',');
    for (const std::string& part : {text.substr(0, comma), comma == std::string::npos ? std::string() : text.substr(comma + 1)}) {
      double value = 0.0;
      const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
      if (error != std::errc() || end != part.data() + part.size() || !std::isfinite(value))
        return fmt::format("{}: write u,v in pixels, such as 402.5,1311", text);
      corners_px.push_back(value);
    }
  }
  if (corners_px.size() != 8) return fmt::format("{} corners; give four, each as u,v", corners_px.size() / 2);
  return {};
}

int run_track(const TrackOptions& options, const std::atomic<bool>& stop) {
  if (!options.covariance.empty() && options.covariance == options.out)
    throw config::UserError(
        fmt::format("{}: markers and covariances cannot be one file; give --covariance another name", options.out.string()));
  if (!options.picture.empty() && !cv::haveImageWriter(options.picture.string()))
    throw config::UserError(
        fmt::format("--picture {}: no kind of image that can be written here; give a name that ends in .png", options.picture.string()));
  cv::setNumThreads(std::max(1, options.tracker.threads));
  return Run(options).run(stop);
}

}  // namespace trocar::tracking
