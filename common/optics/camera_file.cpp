#include "common/optics/camera_file.hpp"

#include <fmt/format.h>

#include "common/config/document.hpp"
#include "common/config/quote.hpp"

namespace trocar::optics {
namespace {

using config::Range;
using config::Table;

constexpr int largest_image_px = 65536;
constexpr Range focal_range{1.0, 1e6};
constexpr Range centre_range{-1e6, 1e6};
constexpr Range term_range{-1e4, 1e4};
constexpr Range deviation_range{0.0, 1e9};

Lens read_lens(const Table& table, Range focal, Range centre, Range term) {
  Lens lens;
  lens.fx_px = table.number("fx_px", focal, "focal length over the width of a pixel, such as 1884.0");
  lens.fy_px = table.number("fy_px", focal, "focal length over the height of a pixel, such as 1884.0");
  lens.cx_px = table.number("cx_px", centre, "the optical axis in the image, such as half its width");
  lens.cy_px = table.number("cy_px", centre, "the optical axis in the image, such as half its height");
  lens.distortion = table.numbers<5>("distortion", term, "[k1, k2, p1, p2, k3], zeros for what there is not");
  return lens;
}

CalibratedView read_view(const Table& table) {
  CalibratedView view;
  view.file = table.text("file", "the image's name");
  view.left_out = table.text_or("left_out", "", "why the view was not used");
  view.outlier = table.flag_or("outlier", false);
  if (view.left_out.empty() || table.has("rms_px")) {
    BoardPose pose;
    pose.rms_px = table.number("rms_px", {0.0, 1e6}, "root mean square distance of the view's corners");
    pose.rotation_rad = table.numbers<3>("rotation_rad", {-10.0, 10.0}, "axis times angle");
    pose.translation_m = table.numbers<3>("translation_m", {-1e4, 1e4}, "the board's first corner in the camera's frame");
    view.pose = pose;
  }
  return view;
}

Calibration read_calibration(const Table& table) {
  Calibration c;
  c.date = table.text("date", "such as \"2026-01-31T12:00:00Z\"");
  c.rms_px = table.number("rms_px", {0.0, 1e6}, "root mean square distance of all corners");
  c.fixed_aspect = table.flag_or("fixed_aspect", false);
  const auto board = table.integers<2>("board", 3, 1000, "columns and rows of inner corners, such as [9, 6]");
  c.columns = static_cast<int>(board[0]);
  c.rows = static_cast<int>(board[1]);
  c.square_m = table.number("square_m", {1e-6, 10.0}, "side of a square, such as 0.025");
  c.standard_deviation = read_lens(table.table("standard_deviation"), deviation_range, deviation_range, deviation_range);
  for (const Table& view : table.tables("view")) c.views.push_back(read_view(view));
  return c;
}

std::string terms_of(const Lens& lens) { return fmt::format("[{}]", fmt::join(lens.distortion, ", ")); }

}  // namespace

Camera read_camera(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const Table root = document.root();
  Camera camera;
  const Table image = root.table("image");
  camera.width_px = static_cast<int>(image.integer("width_px", 1, largest_image_px, "width of the camera's images, such as 2056"));
  camera.height_px = static_cast<int>(image.integer("height_px", 1, largest_image_px, "height of the camera's images, such as 1544"));
  camera.lens = read_lens(root.table("lens"), focal_range, centre_range, term_range);
  if (const auto calibration = root.optional_table("calibration")) camera.calibration = read_calibration(*calibration);
  document.refuse_unknown_keys();
  return camera;
}

// {} prints the shortest text that reads back as the same number.
void write_camera(std::ostream& stream, const Camera& camera) {
  stream << fmt::format("[image]\nwidth_px = {}\nheight_px = {}\n\n", camera.width_px, camera.height_px);
  const Lens& lens = camera.lens;
  stream << fmt::format("[lens]\nfx_px = {}\nfy_px = {}\ncx_px = {}\ncy_px = {}\ndistortion = {}  # k1, k2, p1, p2, k3\n", lens.fx_px,
                        lens.fy_px, lens.cx_px, lens.cy_px, terms_of(lens));
  if (!camera.calibration) return;
  const Calibration& c = *camera.calibration;
  const Lens& deviation = c.standard_deviation;
  stream << fmt::format("\n[calibration]\ndate = {}\nrms_px = {}\nfixed_aspect = {}\nboard = [{}, {}]  # inner corners\nsquare_m = {}\n",
                        config::quote(c.date), c.rms_px, c.fixed_aspect, c.columns, c.rows, c.square_m);
  stream << fmt::format("standard_deviation = {{ fx_px = {}, fy_px = {}, cx_px = {}, cy_px = {}, distortion = {} }}\n", deviation.fx_px,
                        deviation.fy_px, deviation.cx_px, deviation.cy_px, terms_of(deviation));
  for (const CalibratedView& view : c.views) {
    stream << fmt::format("\n[[calibration.view]]\nfile = {}\n", config::quote(view.file));
    if (!view.left_out.empty()) stream << fmt::format("left_out = {}\n", config::quote(view.left_out));
    if (view.outlier) stream << "outlier = true\n";
    if (view.pose)
      stream << fmt::format("rms_px = {}\nrotation_rad = [{}]\ntranslation_m = [{}]\n", view.pose->rms_px,
                            fmt::join(view.pose->rotation_rad, ", "), fmt::join(view.pose->translation_m, ", "));
  }
}

}  // namespace trocar::optics
