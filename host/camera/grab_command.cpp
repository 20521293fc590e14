#include "host/camera/grab_command.hpp"

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/config/quote.hpp"
#include "common/config/user_error.hpp"
#include "host/camera/aravis_source.hpp"
#include "host/camera/clock_offset.hpp"

namespace trocar::camera {
namespace {

constexpr std::chrono::milliseconds look_up{200};

void write_png(const optics::Frame& frame, const std::filesystem::path& file) {
  const bool colour = frame.format == optics::PixelFormat::Rgb8;
  const cv::Mat seen(frame.height_px, frame.width_px, colour ? CV_8UC3 : CV_8UC1,
                     const_cast<std::uint8_t*>(frame.pixels.data()));  // NOLINT
  cv::Mat image = seen;
  if (colour) cv::cvtColor(seen, image, cv::COLOR_RGB2BGR);
  bool written = false;
  try {
    written = cv::imwrite(file.string(), image, {cv::IMWRITE_PNG_COMPRESSION, 1});
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw config::UserError(fmt::format("{}: cannot be written: is the disk full?", file.string()));
}

}  // namespace

int run_list(bool json) {
  const std::vector<FoundCamera> cameras = list_cameras();
  if (json) {
    std::string text;
    for (const FoundCamera& c : cameras)
      text += fmt::format("{}{{\"id\": {}, \"vendor\": {}, \"model\": {}, \"serial\": {}, \"address\": {}, \"protocol\": {}}}",
                          text.empty() ? "" : ", ", config::quote(c.id), config::quote(c.vendor), config::quote(c.model),
                          config::quote(c.serial), config::quote(c.address), config::quote(c.protocol));
    fmt::print("[{}]\n", text);
  } else {
    for (const FoundCamera& c : cameras) fmt::print("aravis:{}  {} {}, {} at {}\n", c.id, c.vendor, c.model, c.protocol, c.address);
  }
  if (cameras.empty())
    fmt::print(stderr,
               "trocar: no camera is found; check its power and cable. GigE: this machine and the camera need addresses in one network "
               "(169.254.x.x "
               "without a server); USB3: your user needs the device (udev rules of the package libaravis)\n");
  return cameras.empty() ? 1 : 0;
}

int run_grab(const GrabOptions& options, const std::atomic<bool>& stop) {
  if (std::filesystem::exists(options.out))
    throw config::UserError(fmt::format("{}: is there already; name a new folder", options.out.string()));
  const auto source = open_source(options.source, options.source_options);
  const Clock clock = source->clock();
  std::error_code error;
  if (!std::filesystem::create_directory(options.out, error))
    throw config::UserError(
        fmt::format("{}: cannot be made: {}; choose a place that exists and is yours", options.out.string(), error.message()));
  std::ofstream table(options.out / "frames.csv", std::ios::binary);
  table << "number,t_s,arrival_s,file\n" << std::flush;
  ClockOffset offset;
  optics::Frame frame;
  std::uint64_t count = 0;
  std::int64_t first_ns = 0, first_arrival_ns = 0;
  int code = 0;
  while (!stop.load() && (options.frames == 0 || count < options.frames)) {
    const Source::Status status = source->next(frame, look_up);
    const std::int64_t arrival_ns = frame.arrived_ns != 0 ? frame.arrived_ns : now_ns();
    for (const std::string& line : source->notices()) fmt::print(stderr, "trocar: {}\n", line);
    if (status == Source::Status::Timeout) continue;
    if (status == Source::Status::End) break;
    if (status == Source::Status::Lost) {
      fmt::print(stderr, "trocar: {}\n", source->what());
      code = 1;
      break;
    }
    if (count == 0) {
      first_ns = frame.time_ns;
      first_arrival_ns = arrival_ns;
    }
    if (clock == Clock::Camera && !offset.see(frame.time_ns, arrival_ns) && count > 0)
      fmt::print(stderr, "trocar: frame {}: the {}'s clock stepped\n", frame.number, to_string(clock));
    const std::string name = fmt::format("frame_{:06}.png", frame.number);
    write_png(frame, options.out / name);
    table << fmt::format("{},{},{},{}\n", frame.number, 1e-9 * static_cast<double>(frame.time_ns - (clock == Clock::Rig ? 0 : first_ns)),
                         1e-9 * static_cast<double>(arrival_ns - first_arrival_ns), name)
          << std::flush;
    if (!table) throw config::UserError(fmt::format("{}: cannot be written: is the disk full?", (options.out / "frames.csv").string()));
    ++count;
  }
  const SourceCounters c = source->counters();
  fmt::print("{} frames into {}; {} lost, {} dropped\n", count, options.out.string(), c.lost, c.dropped);
  if (const auto e = offset.estimate())
    fmt::print("the {}'s clock is {:.6f} s behind this machine's, drifts by {:.1f} us a second, held to {:.1f} us\n", to_string(clock),
               1e-9 * static_cast<double>(e->offset_ns), 1e6 * e->drift, 1e-3 * static_cast<double>(e->uncertainty_ns));
  return code;
}

}  // namespace trocar::camera
