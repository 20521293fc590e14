#include "host/camera/picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <vector>

#include "common/config/user_error.hpp"
#include "host/report/gnuplot.hpp"
#include "host/report/report.hpp"

namespace trocar::camera {
namespace {

class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "trocar_camera_XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr)
      throw config::UserError(fmt::format("{}: no folder can be made there for the picture; set TMPDIR to a place that is yours", pattern));
    path_ = pattern;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_{};
};

// 1, 2 or 5 times a power of ten, not above x.
double round_below(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double digit : {5.0, 2.0})
    if (x >= digit * power) return digit * power;
  return power;
}

std::string script_of(const Fit& fit) {
  const optics::Camera& camera = fit.camera;
  std::vector<double> length, component;
  for (const Residual& r : fit.residuals) {
    length.push_back(std::hypot(r.du_px, r.dv_px));
    component.push_back(r.du_px);
    component.push_back(r.dv_px);
  }
  std::sort(length.begin(), length.end());
  std::vector<double> size = component;
  for (double& x : size) x = std::abs(x);
  std::sort(size.begin(), size.end());
  double square = 0.0;
  for (const double x : component) square += x * x;
  const double sigma = std::max(1e-9, std::sqrt(square / static_cast<double>(component.size())));
  // The median arrow is as long as a fortieth of the image's width.
  const double scale = round_below(camera.width_px / 40.0 / std::max(1e-9, length[length.size() / 2]));
  const double reach = std::max(1e-9, size[size.size() * 98 / 100]);  // of the histogram; the ends hold what lies beyond
  constexpr int bins = 31;
  std::vector<int> count(bins);
  const double width = 2.0 * reach / bins;
  for (const double x : component)
    ++count[static_cast<std::size_t>(std::clamp(static_cast<int>(std::floor((x + reach) / width)), 0, bins - 1))];

  std::string text = "$good << EOD\n", outlier = "$outlier << EOD\n", histogram = "$histogram << EOD\n";
  bool any_outlier = false;
  for (const Residual& r : fit.residuals) {
    (r.outlier ? outlier : text) += fmt::format("{:.3f} {:.3f} {:.3f} {:.3f}\n", r.at.u_px, r.at.v_px, scale * r.du_px, scale * r.dv_px);
    any_outlier = any_outlier || r.outlier;
  }
  for (int k = 0; k < bins; ++k) histogram += fmt::format("{:.6g} {}\n", -reach + (k + 0.5) * width, count[static_cast<std::size_t>(k)]);
  const double peak = static_cast<double>(component.size()) * width / (sigma * 2.5066282746310002);
  text += "EOD\n" + outlier + "EOD\n" + histogram + "EOD\n";
  text += fmt::format(
      "set terminal svg size 1200,560 dynamic noenhanced font 'sans-serif,15' name 'residuals' background '#FFFFFF'\n"
      "set output folder.'/residuals.svg'\nset encoding utf8\nset border 3 lc rgb '#555555'\n"
      "set tics nomirror out scale 0.6 textcolor rgb '#333333'\nset key noautotitle textcolor rgb '#333333'\n"
      "set multiplot\n"
      "set origin 0,0\nset size 0.62,1\nset title 'found minus fitted, {0:g} times as long; RMS {1:.4g} px'\n"
      "set xrange [-0.5:{2}]\nset yrange [{3}:-0.5]\nset size ratio {4:.5g}\nset xlabel 'u [px]'\nset ylabel 'v [px]'\nset key below\n"
      "plot $good using 1:2:3:4 with vectors head filled size {5:.5g},20 lc rgb '#0072B2'",
      scale, camera.calibration->rms_px, camera.width_px - 0.5, camera.height_px - 0.5,
      static_cast<double>(camera.height_px) / camera.width_px, camera.width_px / 120.0);
  if (any_outlier)
    text += fmt::format(", $outlier using 1:2:3:4 with vectors head filled size {:.5g},20 lc rgb '#D55E00' title 'outlier views'",
                        camera.width_px / 120.0);
  text += fmt::format(
      "\nset origin 0.62,0\nset size noratio\nset size 0.38,1\nset title 'components of {0} corners'\nset xrange [{1:.6g}:{2:.6g}]\nset "
      "yrange [0:*]\n"
      "set xlabel 'residual [px]'\nset ylabel 'count'\nset samples 400\n"
      "plot $histogram using 1:2:({3:.6g}) with boxes fs solid 0.6 noborder lc rgb '#56B4E9', {4:.6g}*exp(-0.5*(x/{5:.6g})**2) with lines "
      "lw 1.5 "
      "lc rgb '#333333' title 'normal, {5:.3g} px'\nunset multiplot\n",
      fit.residuals.size(), -1.05 * reach, 1.05 * reach, width, peak, sigma);
  return text;
}

}  // namespace

void draw_residuals(std::ostream& svg, const Fit& fit) {
  const Folder folder;
  try {
    report::run_gnuplot(script_of(fit), folder.path());
  } catch (const report::ReportError& error) {
    throw config::UserError(error.what());
  }
  std::ifstream drawn(folder.path() / "residuals.svg", std::ios::binary);
  svg << drawn.rdbuf();
}

}  // namespace trocar::camera
