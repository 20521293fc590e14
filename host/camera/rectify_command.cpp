#include "host/camera/rectify_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <system_error>

#include "common/config/csv.hpp"
#include "common/config/new_file.hpp"
#include "common/config/quote.hpp"
#include "common/config/user_error.hpp"
#include "common/optics/camera_file.hpp"
#include "host/camera/image.hpp"
#include "host/camera/new_folder.hpp"

namespace trocar::camera {
namespace {

constexpr const char* stopped = "stopped; nothing was written";

// For each rectified pixel the place in the camera's image. Outside of it where the lens shows nothing.
struct Map {
  cv::Mat u{}, v{};
  std::size_t beyond_fold{};
};

Map map_of(const optics::Camera& camera, const optics::Rectifier& rectifier) {
  Map map{cv::Mat(camera.height_px, camera.width_px, CV_32F), cv::Mat(camera.height_px, camera.width_px, CV_32F), 0};
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const optics::Mapped seen = rectifier.distort({static_cast<double>(u), static_cast<double>(v)});
      const bool good = seen.status == optics::Status::Ok;
      // remap counts in 16-bit pixels; nothing is that far outside.
      const auto bounded = [good](double x) { return good ? static_cast<float>(std::clamp(x, -1e4, 3e4)) : -1e4F; };
      map.u.at<float>(v, u) = bounded(seen.pixel.u_px);
      map.v.at<float>(v, u) = bounded(seen.pixel.v_px);
      if (!good) ++map.beyond_fold;
    }
  }
  return map;
}

int rectify_images(const RectifyOptions& options, const optics::Camera& camera, const std::atomic<bool>& stop) {
  constexpr int largest = 30000;
  if (std::max(camera.width_px, camera.height_px) > largest)
    throw config::UserError(fmt::format("{}: image of {} x {} px; images up to {} px wide and high can be rectified, points of any",
                                        options.camera.string(), camera.width_px, camera.height_px, largest));
  std::map<std::string, std::string> names;
  for (const auto& file : options.images) {
    const auto [entry, is_new] = names.emplace(file.stem().string() + ".png", file.string());
    if (!is_new)
      throw config::UserError(
          fmt::format("{}: would become {}, as {} does; rectify them into two folders", file.string(), entry->first, entry->second));
  }
  NewFolder folder(options.out);
  const optics::Rectifier rectifier(camera.lens);
  const Map map = map_of(camera, rectifier);
  const bool show = isatty(STDERR_FILENO) == 1;
  std::size_t done = 0;
  for (const auto& file : options.images) {
    if (stop.load()) throw config::UserError(stopped);
    if (show) fmt::print(stderr, "\r{} of {}: {} \x1b[K", ++done, options.images.size(), file.string());
    cv::Mat image;
    try {
      image = read_image(file, Colour::AsStored);
    } catch (const DamagedImage& e) {
      throw config::UserError(fmt::format("{}: {}; leave it out, or make it anew", file.string(), e.what()));
    }
    if (image.cols != camera.width_px || image.rows != camera.height_px)
      throw config::UserError(fmt::format("{}: {} x {} px, but the camera in {} has {} x {} px; name the camera that took it",
                                          file.string(), image.cols, image.rows, options.camera.string(), camera.width_px,
                                          camera.height_px));
    if (image.depth() != CV_8U && image.depth() != CV_16U)
      throw config::UserError(fmt::format("{}: its pixels are not whole numbers of 8 or 16 bits; convert it first", file.string()));
    bool written = false;
    std::string why = "is the disk full?";
    try {
      cv::Mat rectified;
      cv::remap(image, rectified, map.u, map.v, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
      written = cv::imwrite((folder.part() / (file.stem().string() + ".png")).string(), rectified);
    } catch (const cv::Exception& e) {
      why = e.err;
    }
    if (!written) throw config::UserError(fmt::format("{}: cannot be written as PNG: {}", file.string(), why));
  }
  if (show) fmt::print(stderr, "\r\x1b[K");
  folder.keep();
  if (map.beyond_fold > 0)
    fmt::print(stderr, "trocar: {} of {} pixels are black: the lens folds at {:.4g} focal lengths off its axis, and sees nothing there\n",
               map.beyond_fold, map.u.total(), rectifier.invertible_radius());
  if (options.json)
    fmt::print("{{\"images\": {}, \"folder\": {}, \"beyond_fold_px\": {}, \"invertible_radius\": {}}}\n", options.images.size(),
               config::quote(options.out.string()), map.beyond_fold, rectifier.invertible_radius());
  else
    fmt::print("{} images rectified into {}\n", options.images.size(), options.out.string());
  return 0;
}

int rectify_points(const RectifyOptions& options, const optics::Camera& camera, const std::atomic<bool>& stop) {
  const config::Csv csv = config::Csv::load(options.points, {"u_px,v_px"});
  config::NewFile file(options.out);
  const optics::Rectifier rectifier(camera.lens);
  file.stream() << "u_px,v_px,iterations,status\n";
  std::map<std::string, std::pair<std::size_t, std::string>> trouble;  // rows, place of the first
  int most = 0;
  for (std::size_t row = 0; row < csv.rows(); ++row) {
    if (stop.load()) throw config::UserError(stopped);
    const optics::Pixel from{csv(row, 0), csv(row, 1)};
    const optics::Mapped to = options.distort       ? rectifier.distort(from)
                              : options.fixed_point ? rectifier.fixed_point(from)
                                                    : rectifier.newton(from);
    most = std::max(most, to.iterations);
    if (to.status != optics::Status::Ok) ++trouble.try_emplace(to_string(to.status), 0, csv.where(row)).first->second.first;
    file.stream() << fmt::format("{:.17g},{:.17g},{},{}\n", to.pixel.u_px, to.pixel.v_px, to.iterations, to_string(to.status));
  }
  file.keep();
  std::string counts;
  std::size_t bad = 0;
  for (const auto& [status, rows] : trouble) {
    bad += rows.first;
    counts += fmt::format(", \"{}\": {}", status, rows.first);
    const bool folds = status == to_string(optics::Status::BeyondFold);
    fmt::print(stderr, "trocar: {}: {} of {} points, this is the first: {}; {}\n", rows.second, rows.first, csv.rows(), status,
               folds ? "the lens maps no ray there" : "try --method newton");
  }
  const char* method = options.distort ? "distort" : options.fixed_point ? "fixed-point" : "newton";
  if (options.json)
    fmt::print("{{\"points\": {}, \"ok\": {}, \"method\": \"{}\", \"iterations\": {}, \"invertible_radius\": {}{}}}\n", csv.rows(),
               csv.rows() - bad, method, most, rectifier.invertible_radius(), counts);
  else
    fmt::print("{} of {} points, at most {} iterations ({})\n", csv.rows() - bad, csv.rows(), most, method);
  return 0;
}

}  // namespace

int run_rectify(const RectifyOptions& options, const std::atomic<bool>& stop) {
  const optics::Camera camera = optics::read_camera(options.camera);
  return options.points.empty() ? rectify_images(options, camera, stop) : rectify_points(options, camera, stop);
}

}  // namespace trocar::camera
