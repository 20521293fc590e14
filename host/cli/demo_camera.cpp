#include "host/cli/demo_camera.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "common/config/document.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"

namespace trocar::cli {
namespace {

constexpr double end_s = 20.0;  // the picture, and what is still in the queue

}  // namespace

DemoCamera::DemoCamera(const optics::SimulatedCamera& camera, std::filesystem::path out) : camera_(camera), out_(std::move(out)) {
  // A socket's name is short; the run's folder may lie deep.
  std::error_code error;
  const auto temporary = std::filesystem::temp_directory_path(error);
  if (error)
    throw config::UserError(fmt::format(
        "the folder for temporary files (TMPDIR) is none ({}): set it to one that is yours, or add --no-camera", error.message()));
  std::string name = (temporary / "trocar-XXXXXX").string();  // mkdtemp fills in the Xs
  if (::mkdtemp(name.data()) == nullptr)
    throw config::UserError(
        fmt::format("{}: cannot be made ({}): set TMPDIR to a folder that is yours, or add --no-camera", name, std::strerror(errno)));
  folder_ = name;
}

DemoCamera::~DemoCamera() {
  tracker_.reset();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void DemoCamera::start(std::optional<std::uint32_t> domain) {
  const optics::MarkerGrid& g = camera_.grid;
  std::vector<std::string> words{"track",       "stream:" + socket(),
                                 "--camera",    camera_.name,
                                 "--rows",      std::to_string(g.rows),
                                 "--columns",   std::to_string(g.columns),
                                 "--spacing-m", fmt::format("{}", g.spacing_m),
                                 "--out",       (out_ / "markers.csv").string(),
                                 "--summary",   (out_ / "markers.toml").string(),
                                 "--picture",   (out_ / "markers.jpg").string(),
                                 "--live"};
  if (domain) words.insert(words.end(), {"--domain", std::to_string(*domain), "--threads", "1"});
  tracker_.emplace("trocar-camera", words);
}

void DemoCamera::drain() {
  if (tracker_) (void)tracker_->read(0.0);
}

bool DemoCamera::finish(bool ask) {
  if (!tracker_) return true;
  if (ask) tracker_->signal(SIGINT);
  const int code = tracker_->wait(end_s);
  if (code != 0) fmt::print(stderr, "trocar: the camera's tracker ended with code {}: {}\n", code, tracker_->output());
  tracker_.reset();
  return code == 0;
}

std::optional<optics::SimulatedCamera> demo_camera(const std::string& plant) {
  const config::Document document = config::Document::load(config::find_share("plants", plant));
  const auto table = document.root().optional_table("camera");
  if (!table) return std::nullopt;
  if (!std::filesystem::exists(program_folder() / "trocar-camera")) {
    fmt::print(stderr, "trocar: without its camera, since trocar-camera is not installed\n");
    return std::nullopt;
  }
  return optics::read_simulated_camera(*table);
}

}  // namespace trocar::cli
