#include "host/tracking/grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <queue>

namespace trocar::tracking {
namespace {

constexpr double off_the_step = 0.35;  // of a step: a blob further from its predicted place is no neighbour

struct Blob {
  double u{}, v{}, radius{};
};

double nan() { return std::numeric_limits<double>::quiet_NaN(); }

// Dark against the mean of their surroundings, round enough, and of the size that most have.
std::vector<Blob> find_blobs(const optics::Frame& frame, const Gains& gains, const optics::MarkerGrid& grid) {
  Window all;
  take_window(frame, Grey::Balanced, gains, 0, 0, frame.width_px, frame.height_px, all);
  const cv::Mat level(frame.height_px, frame.width_px, CV_32F, all.level.data());
  // Wide enough to be bright mostly: twice the step of a grid that fills the image.
  const int step = std::max(8, std::min(frame.width_px / std::max(2, grid.columns), frame.height_px / std::max(2, grid.rows)));
  cv::Mat around, smooth;
  cv::boxFilter(level, around, CV_32F, {2 * step + 1, 2 * step + 1}, {-1, -1}, true, cv::BORDER_REFLECT);
  cv::boxFilter(level, smooth, CV_32F, {3, 3}, {-1, -1}, true, cv::BORDER_REFLECT);
  const cv::Mat dark = (smooth < 0.78 * around) & (around - smooth > least_contrast);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(dark.clone(), outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);  // from outside: holes do not count
  std::vector<Blob> blobs;
  for (const auto& outline : outlines) {
    const cv::Moments m = cv::moments(outline);
    if (m.m00 < 6.0) continue;
    const double length = cv::arcLength(outline, true);
    const double roundness = 4.0 * std::numbers::pi * m.m00 / (length * length);
    if (roundness < 0.55) continue;
    // The outline runs through the middles of border pixels, half a pixel within.
    blobs.push_back({m.m10 / m.m00, m.m01 / m.m00, std::sqrt(m.m00 / std::numbers::pi) + 0.5});
  }
  if (blobs.empty()) return blobs;
  std::vector<double> radius;
  // The median over the larger ones: specks are many where an image is noisy.
  const double largest = std::ranges::max(blobs, {}, &Blob::radius).radius;
  for (const Blob& b : blobs)
    if (b.radius > 0.25 * largest) radius.push_back(b.radius);
  std::ranges::nth_element(radius, radius.begin() + static_cast<std::ptrdiff_t>(radius.size() / 2));
  const double usual = radius[radius.size() / 2];
  std::erase_if(blobs, [usual](const Blob& b) { return b.radius < 0.5 * usual || b.radius > 1.8 * usual; });
  return blobs;
}

struct Step {
  double u{}, v{};
};

// Median step to the nearest neighbour on the right and to the one above.
bool steps_of(const std::vector<Blob>& blobs, Step& right, Step& up) {
  std::vector<double> ru, rv, uu, uv;
  for (const Blob& a : blobs) {
    double nearest_right = std::numeric_limits<double>::infinity(), nearest_up = nearest_right;
    Step r, t;
    for (const Blob& b : blobs) {
      const double du = b.u - a.u, dv = b.v - a.v, distance = std::hypot(du, dv);
      if (distance < 1e-9) continue;
      if (du >= std::abs(dv) && distance < nearest_right) {
        nearest_right = distance;
        r = {du, dv};
      }
      if (-dv > std::abs(du) && distance < nearest_up) {
        nearest_up = distance;
        t = {du, dv};
      }
    }
    if (std::isfinite(nearest_right)) {
      ru.push_back(r.u);
      rv.push_back(r.v);
    }
    if (std::isfinite(nearest_up)) {
      uu.push_back(t.u);
      uv.push_back(t.v);
    }
  }
  const auto median = [](std::vector<double>& x) {
    std::ranges::nth_element(x, x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2));
    return x[x.size() / 2];
  };
  if (ru.empty() || uu.empty()) return false;
  right = {median(ru), median(rv)};
  up = {median(uu), median(uv)};
  return true;
}

struct Cell {
  int row{}, column{};
  friend auto operator<=>(const Cell&, const Cell&) = default;
};

// Blobs by their cell, counted from one near the middle.
std::map<Cell, std::size_t> link(const std::vector<Blob>& blobs, const Step& right, const Step& up, std::size_t seed) {
  std::map<Cell, std::size_t> cells{{{0, 0}, seed}};
  std::vector<bool> used(blobs.size());
  used[seed] = true;
  struct Entry {
    Cell cell{};
    std::size_t blob{};
    Step right{}, up{};  // as they are here
  };
  std::queue<Entry> queue;
  queue.push({{0, 0}, seed, right, up});
  const std::array<Cell, 4> ways{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
  while (!queue.empty()) {
    const Entry e = queue.front();
    queue.pop();
    for (const Cell& way : ways) {
      const Cell cell{e.cell.row + way.row, e.cell.column + way.column};
      if (cells.contains(cell)) continue;
      const Step step{way.column * e.right.u + way.row * e.up.u, way.column * e.right.v + way.row * e.up.v};
      const double u = blobs[e.blob].u + step.u, v = blobs[e.blob].v + step.v, length = std::hypot(step.u, step.v);
      std::size_t nearest = blobs.size();
      double distance = off_the_step * length;
      for (std::size_t k = 0; k < blobs.size(); ++k) {
        const double d = std::hypot(blobs[k].u - u, blobs[k].v - v);
        if (!used[k] && d < distance) {
          distance = d;
          nearest = k;
        }
      }
      if (nearest == blobs.size()) continue;
      used[nearest] = true;
      cells.emplace(cell, nearest);
      Entry next{cell, nearest, e.right, e.up};
      // Half of the way to the step that was found: one dot off its place does not lead the next astray.
      Step& along = way.row == 0 ? next.right : next.up;
      const double sign = way.row + way.column;
      along.u += 0.5 * (sign * (blobs[nearest].u - blobs[e.blob].u) - along.u);
      along.v += 0.5 * (sign * (blobs[nearest].v - blobs[e.blob].v) - along.v);
      queue.push(next);
    }
  }
  return cells;
}

}  // namespace

void fill_missing(std::vector<Place>& place, const optics::MarkerGrid& grid) {
  bool changed = true;
  while (changed) {
    changed = false;
    const std::vector<Place> known = place;
    const auto at = [&](int row, int column) -> const Place* {
      if (row < 0 || column < 0 || row >= grid.rows || column >= grid.columns) return nullptr;
      const Place& p = known[grid.index(row, column)];
      return std::isnan(p.u_px) ? nullptr : &p;
    };
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        if (at(row, column) != nullptr) continue;
        double u = 0.0, v = 0.0, weight = 0.0;
        for (int a = -1; a <= 1; ++a) {
          for (int b = -1; b <= 1; ++b) {
            if (a == 0 && b == 0) continue;
            const Place* one = at(row + a, column + b);
            if (one == nullptr) continue;
            if (const Place* opposite = at(row - a, column - b)) {  // counted from both sides
              u += 2.0 * 0.5 * (one->u_px + opposite->u_px);
              v += 2.0 * 0.5 * (one->v_px + opposite->v_px);
              weight += 2.0;
            } else if (const Place* two = at(row + 2 * a, column + 2 * b)) {
              u += 2.0 * one->u_px - two->u_px;
              v += 2.0 * one->v_px - two->v_px;
              weight += 1.0;
            }
          }
        }
        if (weight == 0.0) continue;
        place[grid.index(row, column)] = {u / weight, v / weight};
        changed = true;
      }
    }
  }
}

DetectedGrid detect_grid(const optics::Frame& frame, const Gains& gains, const optics::MarkerGrid& grid) {
  DetectedGrid out;
  const std::vector<Blob> blobs = find_blobs(frame, gains, grid);
  const auto no_grid = [&](std::string problem) {
    out.problem = std::move(problem);
    out.place.clear();
    return out;
  };
  if (blobs.size() < 4)
    return no_grid(fmt::format("{} dark dots were found, the grid has {}; look at the light, or name the corners with --corners",
                               blobs.size(), grid.markers()));
  Step right, up;
  if (!steps_of(blobs, right, up)) return no_grid("the dots form no grid; name its corners with --corners");
  // Begin near the middle of the dots: the grid is whole there. Should the first be a stray blob, the next may not be.
  double mu = 0.0, mv = 0.0;
  for (const Blob& b : blobs) {
    mu += b.u / static_cast<double>(blobs.size());
    mv += b.v / static_cast<double>(blobs.size());
  }
  std::vector<std::size_t> order(blobs.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::ranges::sort(order, {}, [&](std::size_t k) { return std::hypot(blobs[k].u - mu, blobs[k].v - mv); });
  std::map<Cell, std::size_t> cells;
  for (std::size_t k = 0; k < std::min<std::size_t>(5, order.size()); ++k) {
    auto linked = link(blobs, right, up, order[k]);
    if (linked.size() > cells.size()) cells = std::move(linked);
    if (2 * cells.size() > blobs.size()) break;
  }
  int top = 0, bottom = 0, left = 0, rightmost = 0;
  for (const auto& [cell, blob] : cells) {
    bottom = std::min(bottom, cell.row);
    top = std::max(top, cell.row);
    left = std::min(left, cell.column);
    rightmost = std::max(rightmost, cell.column);
  }
  const int rows = top - bottom + 1, columns = rightmost - left + 1;
  const auto found = [&] { return fmt::format("a grid of {} rows and {} columns with {} dots was found", rows, columns, cells.size()); };
  if (rows < grid.rows || columns < grid.columns)
    return no_grid(fmt::format("{}, not of {} and {}; give --rows and --columns, or name the corners with --corners", found(), grid.rows,
                               grid.columns));
  // Where the grid of this size holds the most dots. Strays beside it make it ambiguous only where they are as many as a whole side.
  int best = -1, second = -1;
  Cell corner;
  for (int row = bottom; row + grid.rows - 1 <= top; ++row) {
    for (int column = left; column + grid.columns - 1 <= rightmost; ++column) {
      int inside = 0;
      for (const auto& [cell, blob] : cells)
        inside += cell.row >= row && cell.row < row + grid.rows && cell.column >= column && cell.column < column + grid.columns ? 1 : 0;
      if (inside > best) {
        second = best;
        best = inside;
        corner = {row, column};
      } else {
        second = std::max(second, inside);
      }
    }
  }
  if (second > best - std::min(grid.rows, grid.columns) / 3)
    return no_grid(
        fmt::format("{}, in which {} and {} fit in several places; give --rows and --columns, or name the corners with --corners", found(),
                    grid.rows, grid.columns));
  if (static_cast<std::size_t>(2 * best) < grid.markers())
    return no_grid(fmt::format("{}: fewer than half of {}; name the corners with --corners", found(), grid.markers()));
  out.place.assign(grid.markers(), {nan(), nan()});
  std::vector<double> radius;
  for (const auto& [cell, blob] : cells) {
    const int row = cell.row - corner.row, column = cell.column - corner.column;
    if (row < 0 || column < 0 || row >= grid.rows || column >= grid.columns) continue;
    out.place[grid.index(row, column)] = {blobs[blob].u, blobs[blob].v};
    radius.push_back(blobs[blob].radius);
    ++out.seen;
  }
  std::ranges::nth_element(radius, radius.begin() + static_cast<std::ptrdiff_t>(radius.size() / 2));
  out.radius_px = radius[radius.size() / 2];
  return out;
}

}  // namespace trocar::tracking
