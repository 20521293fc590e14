#include "host/tracking/tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core/utility.hpp>

namespace trocar::tracking {
namespace {

constexpr double stray_part = 0.35;    // of a step of the grid: as far as a marker may stray from what its neighbours say
constexpr double parted_part = 0.5;    // of a step: neighbours do not part by more
constexpr double together_part = 0.5;  // of a step: two markers closer than this are on one dot
constexpr double size_part = 0.2;  // by which a dot's radius may differ from what it was: half of one under a cover looks like another size
constexpr double good_score = 0.8;
constexpr int recovery_rounds = 4;          // lost ones next to lost ones
constexpr std::uint64_t longest_coast = 3;  // frames for which a velocity is believed

double nan() { return std::numeric_limits<double>::quiet_NaN(); }
double distance(const Place& a, const Place& b) { return std::hypot(a.u_px - b.u_px, a.v_px - b.v_px); }

}  // namespace

Tracker::Tracker(const TrackerOptions& options)
    : options_(options),
      track_(options.grid.markers()),
      marker_(options.grid.markers()),
      located_(options.grid.markers()),
      scratch_(static_cast<std::size_t>(std::max(1, options.threads))),
      from_(options.grid.markers()),
      tried_(options.grid.markers()) {
  sought_.reserve(options.grid.markers());
}

std::size_t Tracker::valid() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(marker_, [](const Marker& m) { return m.valid; }));
}

std::vector<Place> Tracker::rest() const {
  std::vector<Place> out;
  for (const Track& t : track_) out.push_back(t.known ? t.rest : Place{nan(), nan()});
  return out;
}

std::string Tracker::start(const optics::Frame& frame) {
  gains_ = white_balance(frame);
  DetectedGrid grid = detect_grid(frame, gains_, options_.grid);
  if (!grid.problem.empty()) return grid.problem;
  std::string problem = start(frame, std::move(grid.place), grid.radius_px);
  detected_ = true;
  return problem;
}

std::string Tracker::start(const optics::Frame& frame, std::vector<Place> places, double radius_px) {
  gains_ = white_balance(frame);
  detected_ = false;
  number_ = frame.number;
  radius_px_ = radius_px;
  disc_.emplace(radius_px);
  fill_missing(places, options_.grid);
  std::vector<double> steps;
  const optics::MarkerGrid& g = options_.grid;
  for (int row = 0; row < g.rows; ++row)
    for (int column = 0; column + 1 < g.columns; ++column)
      steps.push_back(distance(places[g.index(row, column)], places[g.index(row, column + 1)]));
  for (int row = 0; row + 1 < g.rows; ++row)
    for (int column = 0; column < g.columns; ++column)
      steps.push_back(distance(places[g.index(row, column)], places[g.index(row + 1, column)]));
  std::erase_if(steps, [](double s) { return std::isnan(s); });
  if (steps.empty()) {  // a single marker has no neighbours to be mistaken for
    step_px_ = 6.0 * radius_px;
  } else {
    std::ranges::nth_element(steps, steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2));
    step_px_ = steps[steps.size() / 2];
  }
  sought_.resize(track_.size());
  std::iota(sought_.begin(), sought_.end(), std::size_t{0});
  from_ = places;
  std::ranges::fill(located_, Located{});
  for (std::size_t k = 0; k < track_.size(); ++k) {
    track_[k] = {};
    track_[k].rest = track_[k].last = places[k];
    track_[k].radius_px = radius_px;
  }
  search(frame);
  judge();
  recover(frame);
  for (std::size_t k = 0; k < track_.size(); ++k)
    if (located_[k].found) track_[k].rest = {located_[k].u_px, located_[k].v_px};
  keep(frame.number);
  if (2 * valid() < marker_.size())
    return fmt::format("{} of {} markers were found where the grid should be; look at the light, at the corners, and at the dots' diameter",
                       valid(), marker_.size());
  return {};
}

std::span<const Marker> Tracker::update(const optics::Frame& frame) {
  const std::uint64_t elapsed = frame.number > number_ ? frame.number - number_ : 1;
  std::ranges::fill(located_, Located{});
  if (elapsed > longest_coast) seek_in_new_grid(frame);
  if (2 * found() < located_.size()) {
    sought_.clear();
    for (std::size_t k = 0; k < track_.size(); ++k) {
      const Track& t = track_[k];
      if (!marker_[k].valid || located_[k].found) continue;
      const auto frames = static_cast<double>(std::min(elapsed, longest_coast));
      from_[k] = {t.last.u_px + frames * t.step.u_px, t.last.v_px + frames * t.step.v_px};
      sought_.push_back(k);
    }
    search(frame);
    judge();
    recover(frame);
    if (2 * found() < located_.size()) find_again(frame, elapsed <= longest_coast);
  }
  if (2 * found() >= located_.size()) number_ = frame.number;
  keep(frame.number);
  return marker_;
}

std::size_t Tracker::found() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(located_, [](const Located& l) { return l.found; }));
}

// Most markers are lost, so that neighbours say little.
void Tracker::find_again(const optics::Frame& frame, bool grid_too) {
  sought_.clear();
  for (std::size_t k = 0; k < track_.size(); ++k) {
    if (located_[k].found || !track_[k].known) continue;
    from_[k] = track_[k].last;
    sought_.push_back(k);
  }
  search(frame);
  judge();
  recover(frame);
  if (grid_too && 2 * found() < located_.size()) seek_in_new_grid(frame);
}

void Tracker::seek_in_new_grid(const optics::Frame& frame) {
  if (!detected_) return;
  const DetectedGrid grid = detect_grid(frame, gains_, options_.grid);
  if (!grid.problem.empty()) return;
  sought_.clear();
  for (std::size_t k = 0; k < track_.size(); ++k) {
    located_[k] = {};
    from_[k] = grid.place[k];
    if (std::isfinite(from_[k].u_px)) sought_.push_back(k);
  }
  search(frame);
  judge();
  recover(frame);
}

Located Tracker::locate(const optics::Frame& frame, const Place& start, double radius_px, bool known_size, Scratch& scratch) const {
  if (!std::isfinite(start.u_px) || !std::isfinite(start.v_px)) return {};
  if (options_.method == Method::Correlation)
    return locate_by_correlation(frame, gains_, start, *disc_, options_.neighbourhood_px, scratch);
  Located l = locate_by_edge(frame, gains_, start, radius_px, scratch);
  if (known_size && std::abs(l.radius_px - radius_px) > size_part * radius_px) l.found = false;
  return l;
}

void Tracker::search(const optics::Frame& frame) {
  // Each thread takes the next few markers: lost ones cost more, and are not spread evenly.
  constexpr std::size_t few = 16;
  std::atomic<std::size_t> next{0};
  const auto work = [&](const cv::Range& range) {
    for (int t = range.start; t < range.end; ++t) {
      Scratch& scratch = scratch_[static_cast<std::size_t>(t)];
      for (std::size_t begin = next.fetch_add(few); begin < sought_.size(); begin = next.fetch_add(few)) {
        for (std::size_t i = begin; i < std::min(begin + few, sought_.size()); ++i) {
          const std::size_t k = sought_[i];
          located_[k] = locate(frame, from_[k], track_[k].radius_px, track_[k].sightings > 0, scratch);
        }
      }
    }
  };
  // OpenCV's own pool, which stays.
  const cv::Range threads(0, static_cast<int>(scratch_.size()));
  if (scratch_.size() == 1 || sought_.size() <= few)
    work({0, 1});
  else
    cv::parallel_for_(threads, work, static_cast<double>(scratch_.size()));
}

// Where the neighbours that were seen say that a marker is: its first place and the mean of their displacements, opposite ones first, since
// together they cancel what grows along a line.
std::optional<Place> Tracker::expected(std::size_t k) const {
  const optics::MarkerGrid& g = options_.grid;
  const int row = static_cast<int>(k) / g.columns, column = static_cast<int>(k) % g.columns;
  const auto displacement = [&](int a, int b) -> std::optional<Place> {
    if (row + a < 0 || column + b < 0 || row + a >= g.rows || column + b >= g.columns) return std::nullopt;
    const std::size_t n = g.index(row + a, column + b);
    if (!located_[n].found || std::isnan(track_[n].rest.u_px)) return std::nullopt;
    return Place{located_[n].u_px - track_[n].rest.u_px, located_[n].v_px - track_[n].rest.v_px};
  };
  Place pairs{}, singles{};
  int paired = 0, single = 0;
  for (int a = -1; a <= 1; ++a) {
    for (int b = -1; b <= 1; ++b) {
      if (a == 0 && b == 0) continue;
      const auto one = displacement(a, b), opposite = displacement(-a, -b);
      if (!one) continue;
      singles = {singles.u_px + one->u_px, singles.v_px + one->v_px};
      ++single;
      if (!opposite) continue;
      pairs = {pairs.u_px + one->u_px, pairs.v_px + one->v_px};  // the opposite one adds its own when its turn comes
      ++paired;
    }
  }
  if (single < 2) return std::nullopt;
  const Place sum = paired > 0 ? pairs : singles;
  const double n = paired > 0 ? paired : single;
  return Place{track_[k].rest.u_px + sum.u_px / n, track_[k].rest.v_px + sum.v_px / n};
}

// Where tissue springs back faster than the camera looks, whole blocks of markers may agree with each other and all sit one dot further on.
// Their border gives them away: neighbours do not part by half a step. What hangs together is kept where it is largest.
void Tracker::keep_largest_whole() {
  const optics::MarkerGrid& g = options_.grid;
  const double most = parted_part * step_px_;
  std::vector<std::size_t> whole(located_.size(), 0), queue;
  std::size_t count = 0, largest = 0, best = 0;
  for (std::size_t begin = 0; begin < located_.size(); ++begin) {
    if (!located_[begin].found || whole[begin] != 0 || std::isnan(track_[begin].rest.u_px)) continue;
    ++count;
    whole[begin] = count;
    queue.assign(1, begin);
    for (std::size_t at = 0; at < queue.size(); ++at) {
      const std::size_t k = queue[at];
      const int row = static_cast<int>(k) / g.columns, column = static_cast<int>(k) % g.columns;
      for (const auto& [a, b] : {std::pair{0, 1}, std::pair{1, 0}, std::pair{0, -1}, std::pair{-1, 0}}) {
        if (row + a < 0 || row + a >= g.rows || column + b < 0 || column + b >= g.columns) continue;
        const std::size_t n = g.index(row + a, column + b);
        if (!located_[n].found || whole[n] != 0 || std::isnan(track_[n].rest.u_px)) continue;
        const double du = (located_[n].u_px - track_[n].rest.u_px) - (located_[k].u_px - track_[k].rest.u_px);
        const double dv = (located_[n].v_px - track_[n].rest.v_px) - (located_[k].v_px - track_[k].rest.v_px);
        if (std::hypot(du, dv) > most) continue;
        whole[n] = count;
        queue.push_back(n);
      }
    }
    if (queue.size() > largest) {
      largest = queue.size();
      best = count;
    }
  }
  // Smaller ones that touch the largest contradict it; those apart, behind lost ones, may be right.
  std::vector<bool> contradicts(count + 1);
  for (std::size_t k = 0; k < located_.size(); ++k) {
    if (whole[k] != best) continue;
    const int row = static_cast<int>(k) / g.columns, column = static_cast<int>(k) % g.columns;
    for (const auto& [a, b] : {std::pair{0, 1}, std::pair{1, 0}, std::pair{0, -1}, std::pair{-1, 0}}) {
      if (row + a < 0 || row + a >= g.rows || column + b < 0 || column + b >= g.columns) continue;
      const std::size_t n = whole[g.index(row + a, column + b)];
      if (n != 0 && n != best) contradicts[n] = true;
    }
  }
  for (std::size_t k = 0; k < located_.size(); ++k)
    if (contradicts[whole[k]]) located_[k].found = false;
}

void Tracker::judge() {
  keep_largest_whole();
  // The worst first, since one that strays misleads its neighbours' expectations too; each round takes one away, so there is an end.
  const double most = stray_part * step_px_;
  for (std::size_t round = 0; round < located_.size(); ++round) {
    std::size_t worst = located_.size();
    double strays = most;
    for (std::size_t k = 0; k < located_.size(); ++k) {
      if (!located_[k].found) continue;
      const auto place = expected(k);
      if (!place) continue;
      const double d = distance({located_[k].u_px, located_[k].v_px}, *place);
      if (d > strays) {
        strays = d;
        worst = k;
      }
    }
    if (worst == located_.size()) break;
    located_[worst].found = false;
  }
  keep_largest_whole();
  // Two on one dot: the one that its neighbours expect elsewhere goes, both when they expect nothing.
  const optics::MarkerGrid& g = options_.grid;
  for (int row = 0; row < g.rows; ++row) {
    for (int column = 0; column < g.columns; ++column) {
      const std::size_t k = g.index(row, column);
      for (const auto& [a, b] : {std::pair{0, 1}, std::pair{1, 0}, std::pair{1, 1}, std::pair{1, -1}}) {
        if (row + a >= g.rows || column + b < 0 || column + b >= g.columns) continue;
        const std::size_t n = g.index(row + a, column + b);
        if (!located_[k].found || !located_[n].found) continue;
        const Place p{located_[k].u_px, located_[k].v_px}, q{located_[n].u_px, located_[n].v_px};
        if (distance(p, q) > together_part * step_px_) continue;
        const auto ep = expected(k), eq = expected(n);
        const double dp = ep ? distance(p, *ep) : most, dq = eq ? distance(q, *eq) : most;
        if (dp >= dq) located_[k].found = false;
        if (dq >= dp) located_[n].found = false;
      }
    }
  }
}

void Tracker::recover(const optics::Frame& frame) {
  std::ranges::fill(tried_, 0);
  for (int round = 0; round < recovery_rounds; ++round) {
    sought_.clear();
    for (std::size_t k = 0; k < located_.size(); ++k) {
      if (located_[k].found || tried_[k] != 0) continue;
      auto place = expected(k);
      // Alone in the image: where it was last.
      if (!place && located_.size() == 1) place = track_[k].last;
      if (!place || !std::isfinite(place->u_px)) continue;
      from_[k] = *place;
      tried_[k] = 1;
      sought_.push_back(k);
    }
    if (sought_.empty()) return;
    search(frame);
    for (const std::size_t k : sought_)
      if (located_[k].found && distance({located_[k].u_px, located_[k].v_px}, from_[k]) > stray_part * step_px_) located_[k].found = false;
    judge();
  }
}

void Tracker::keep(std::uint64_t number) {
  for (std::size_t k = 0; k < track_.size(); ++k) {
    const Located& l = located_[k];
    Track& t = track_[k];
    marker_[k] = {l.found, l.found ? l.u_px : nan(), l.found ? l.v_px : nan(), l.score,
                  l.found ? l.covariance : std::array{nan(), nan(), nan()}};
    if (!l.found) continue;
    const Place now{l.u_px, l.v_px};
    if (!t.known && std::isnan(t.rest.u_px)) t.rest = now;
    const auto frames = static_cast<double>(number - t.seen);
    t.step = t.known && number > t.seen && number - t.seen <= longest_coast
                 ? Place{(now.u_px - t.last.u_px) / frames, (now.v_px - t.last.v_px) / frames}
                 : Place{};
    t.last = now;
    t.seen = number;
    t.known = true;
    // A dot keeps its size but for noise and strain: the mean of its first sightings, then slowly on. Only of good ones.
    if (options_.method == Method::Edge && l.score > good_score)
      t.radius_px += (l.radius_px - t.radius_px) / static_cast<double>(t.sightings < 20 ? ++t.sightings : 100);
  }
}

}  // namespace trocar::tracking
