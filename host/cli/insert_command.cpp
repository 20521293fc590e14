#include "host/cli/insert_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/condense/compile.hpp"
#include "common/config/csv.hpp"
#include "common/config/new_file.hpp"
#include "common/config/user_error.hpp"
#include "common/fem/subdivide.hpp"
#include "common/insertion/insertion.hpp"
#include "common/scene/scene.hpp"

namespace trocar::cli {
namespace {

using insertion::Insertion;
using insertion::Pose;
using insertion::Result;
using insertion::Status;

constexpr double longest_step_m = 1e-4;
constexpr int most_steps = 100000;  // between two rows
constexpr std::string_view path_header = "t_s,x_m,y_m,theta_rad";

struct Row {
  double t_s{};
  Pose pose{};
};

std::vector<Row> read_path(const std::filesystem::path& file) {
  const config::Csv csv = config::Csv::load(file, {path_header});
  std::vector<Row> rows;
  for (std::size_t i = 0; i < csv.rows(); ++i) {
    rows.push_back({csv(i, 0), {csv(i, 1), csv(i, 2), csv(i, 3)}});
    if (i > 0 && !(rows[i].t_s > rows[i - 1].t_s))
      csv.fail(i, fmt::format("t_s = {}: not later than the row before ({}); sort the rows by time", rows[i].t_s, rows[i - 1].t_s));
  }
  return rows;
}

contact::Method method_of(const std::string& name) {
  static const std::map<std::string, contact::Method> methods{{"embedded", contact::Method::Embedded},
                                                              {"snap", contact::Method::Snap},
                                                              {"adapt", contact::Method::Adapt},
                                                              {"subdivide", contact::Method::Subdivide}};
  const auto found = methods.find(name);
  if (found == methods.end())
    throw config::UserError(fmt::format("--method {}: there is no such method; write embedded, snap, adapt or subdivide", name));
  return found->second;
}

std::string_view name_of(contact::State state) {
  switch (state) {
    case contact::State::Stuck:
      return "stuck";
    case contact::State::SlipForward:
      return "slip_forward";
    case contact::State::SlipBackward:
      break;
  }
  return "slip_backward";
}

// From one entry to the complete withdrawal, the first path row with a contact onwards.
struct Cut {
  std::size_t row{};
  std::vector<fem::Point> point{};         // that the tip cuts through
  std::vector<std::uint32_t> candidate{};  // nodes of the cut mesh on it, those supported left out
};

// A compiled scene and a needle in it. The large objects live on the heap.
class Run {
 public:
  Run(const scene::Scene& scene, const condense::Plan& plan, std::vector<Cut> cuts = {}) : cuts_(std::move(cuts)) {
    condense::Options options;
    options.visible = condense::WithVisible::No;
    const bool show = isatty(STDERR_FILENO) == 1;
    if (show)
      options.progress = [](std::string_view phase, double fraction) { fmt::print(stderr, "\r{} {:3.0f} % ", phase, 100 * fraction); };
    compiled_ = condense::compile(scene, plan, options);
    if (show) fmt::print(stderr, "\r\x1b[K");
    const model::ImageStatus status = model::open(compiled_.image.span(), image_);
    if (status != model::ImageStatus::Ok) throw config::UserError(fmt::format("{}: {}", scene.file.string(), to_string(status)));
    insertion_->open(image_);
  }

  // From the last row to this one, number `at`. Returns the last step's result with the pivots of all, and the first status that is not Ok
  // in `worst`.
  Result advance(std::size_t at, const Row& row, Status& worst) {
    if (insertion_->contacts() == 0)
      for (const Cut& cut : cuts_)
        if (cut.row == at) insertion_->working_set().name_nodes(cut.candidate);
    int steps = 1;
    if (last_ && image_.law->explicit_count == 0) {
      const double length = image_.needle.length_m;
      const auto tip = [length](const Pose& p) {
        return std::array{p.x_m + length * std::cos(p.theta_rad), p.y_m + length * std::sin(p.theta_rad)};
      };
      const double turn = std::abs(row.pose.theta_rad - last_->pose.theta_rad) * length;
      const double base = std::hypot(row.pose.x_m - last_->pose.x_m, row.pose.y_m - last_->pose.y_m);
      const double way = std::hypot(tip(row.pose)[0] - tip(last_->pose)[0], tip(row.pose)[1] - tip(last_->pose)[1]);
      const double needed = std::ceil(std::max({turn, base, way}) / longest_step_m);
      steps = static_cast<int>(std::clamp(needed, 1.0, static_cast<double>(most_steps)));
    }
    Result result;
    int pivots = 0;
    for (int k = 1; k <= steps; ++k) {
      const double part = static_cast<double>(k) / steps;
      Pose pose = row.pose;
      if (k < steps) {
        const Pose& from = last_->pose;
        pose = {from.x_m + part * (row.pose.x_m - from.x_m), from.y_m + part * (row.pose.y_m - from.y_m),
                from.theta_rad + part * (row.pose.theta_rad - from.theta_rad)};
      }
      const double dt = last_ ? (row.t_s - last_->t_s) / steps : 0.0;
      result = insertion_->step(pose, dt);
      pivots += result.pivots;
      worst = std::max(worst, result.status);
    }
    last_ = row;
    result.pivots = pivots;
    return result;
  }

  [[nodiscard]] const Insertion& insertion() const { return *insertion_; }
  [[nodiscard]] const model::Image& image() const { return image_; }

 private:
  std::vector<Cut> cuts_{};
  condense::Compiled compiled_{};
  model::Image image_{};
  std::unique_ptr<Insertion> insertion_ = std::make_unique<Insertion>();
  std::optional<Row> last_{};
};

[[noreturn]] void leaves_corridor(const std::filesystem::path& path_file, const scene::Scene& scene, const Row& row) {
  throw config::UserError(fmt::format("{}: at t_s = {} the path leaves the candidate corridor; widen contact.corridor in {}",
                                      path_file.string(), row.t_s, scene.file.string()));
}

// The material points that the tip cuts through, a quarter of an edge apart but for the last one, by the embedded method.
std::vector<Cut> cut_paths(const scene::Scene& scene, const std::filesystem::path& path_file, const std::vector<Row>& path) {
  scene::Scene embedded = scene;
  embedded.contact->method = contact::Method::Embedded;
  Run run(embedded, condense::plan(embedded, condense::WithVisible::No));
  const double edge_m = run.image().tissue.edge_length_m;
  std::vector<Cut> cuts;
  double deepest = 0.0;
  bool outside = true;
  for (std::size_t i = 0; i < path.size(); ++i) {
    Status worst = Status::Ok;
    (void)run.advance(i, path[i], worst);
    if (worst == Status::LeftCandidates) leaves_corridor(path_file, scene, path[i]);
    const contact::WorkingSet& set = run.insertion().working_set();
    if (set.size() == 0) {
      outside = true;
      continue;
    }
    if (outside) {
      const auto& entry = set.point(0).begin_m;
      cuts.push_back({.row = i, .point = {{entry[0], entry[1], 0.0}}});
      deepest = 0.0;
      outside = false;
    }
    if (!(set.deepest_m() > deepest)) continue;
    deepest = set.deepest_m();
    std::vector<fem::Point>& points = cuts.back().point;
    const auto tip = set.tip_material_m();
    const auto to_tip = [&tip](const fem::Point& x) { return std::hypot(tip[0] - x[0], tip[1] - x[1]); };
    if (to_tip(points.back()) == 0.0) continue;
    // The last point is where the tip was deepest; those before it stay apart.
    if (points.size() > 1 && to_tip(points[points.size() - 2]) < 0.25 * edge_m) points.pop_back();
    points.push_back({tip[0], tip[1], 0.0});
  }
  return cuts;
}

// Nodes along the cut in order; the mesh gets them where it has none.
std::vector<int> cut_mesh(fem::Mesh& mesh, const std::vector<fem::Point>& points) {
  std::vector<int> nodes;
  for (std::size_t i = 1; i < points.size(); ++i)
    for (const int node : fem::subdivide(mesh, points[i - 1], points[i]))
      if (std::find(nodes.begin(), nodes.end(), node) == nodes.end()) nodes.push_back(node);
  return nodes;
}

// Subdivide: the mesh is cut along the path that the embedded method finds; then the cut's nodes are contacts as they are passed.
Run subdivided(scene::Scene scene, const std::filesystem::path& path_file, const std::vector<Row>& path) {
  std::vector<Cut> cuts = cut_paths(scene, path_file, path);
  fem::Mesh mesh;
  std::vector<std::vector<int>> nodes;
  try {
    mesh = fem::make_mesh(scene.tissue);
    for (const Cut& cut : cuts) nodes.push_back(cut_mesh(mesh, cut.point));
  } catch (const fem::Error& error) {
    throw config::UserError(fmt::format("{}: {}", scene.file.string(), error.what()));
  }
  scene.contact->method = contact::Method::Snap;
  condense::Plan plan = condense::plan(scene, std::move(mesh), condense::WithVisible::No);
  // Candidates of planar tissue are the mesh's own nodes.
  std::map<model::Vector2, std::uint32_t> candidate;
  for (std::uint32_t n = 0; n < plan.candidates.node_m.size(); ++n) candidate.emplace(plan.candidates.node_m[n], n);
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    for (const int node : nodes[k]) {
      const fem::Point& x = plan.mesh.node[static_cast<std::size_t>(node)];
      const auto found = candidate.find({x[0], x[1]});
      if (found == candidate.end()) leaves_corridor(path_file, scene, path[cuts[k].row]);
      if ((plan.candidates.flags[found->second] & (model::fixed_x | model::fixed_y)) == 0) cuts[k].candidate.push_back(found->second);
    }
    if (cuts[k].candidate.size() > capacity::contacts)
      throw config::UserError(
          fmt::format("{}: the cut along the path has {} nodes, each of them a contact, and the capacity is {}; take a "
                      "coarser mesh, a shorter path or the method \"embedded\"",
                      scene.file.string(), cuts[k].candidate.size(), capacity::contacts));
  }
  return {scene, plan, std::move(cuts)};
}

std::string off_shaft(const scene::Scene& scene, const Pose& base) {
  const contact::Law& law = *scene.contact;
  for (std::size_t i = 0; i < law.explicit_count; ++i) {
    const double x = law.explicit_point_m[i][0];
    const double y = law.explicit_point_m[i][1];
    const double lateral = std::cos(base.theta_rad) * (y - base.y_m) - std::sin(base.theta_rad) * (x - base.x_m);
    const double axial = std::cos(base.theta_rad) * (x - base.x_m) + std::sin(base.theta_rad) * (y - base.y_m);
    if (axial < -Insertion::explicit_point_tolerance_m)
      return fmt::format(
          "contact.points_m: point {} ({}, {}) m lies {:.3g} m behind the base of the first path row (({}, {}) m, theta {} rad); "
          "begin the path with the base in front of all points",
          i + 1, x, y, -axial, base.x_m, base.y_m, base.theta_rad);
    if (scene.needle->curvature_per_m == 0.0 && std::abs(lateral) > Insertion::explicit_point_tolerance_m)
      return fmt::format(
          "contact.points_m: point {} ({}, {}) m lies {:.3g} m beside the shaft of the first path row (base ({}, {}) m, theta {} rad); "
          "move it onto the shaft, to 1e-9 m",
          i + 1, x, y, std::abs(lateral), base.x_m, base.y_m, base.theta_rad);
  }
  if (scene.needle->curvature_per_m != 0.0)
    return fmt::format(
        "contact.points_m: a point lies beside the shaft of the first path row, which is curved (needle.curvature_per_m = {}); move it "
        "onto the curved shaft, to 1e-9 m",
        scene.needle->curvature_per_m);
  return "contact.points_m: a point lies outside of the candidates; widen contact.corridor";
}

class Lines {
 public:
  Lines(const std::filesystem::path& file, std::string_view header) : file_(file) { text_ = fmt::format("{}\n", header); }
  template <typename... T>
  void add(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
    if (text_.size() >= flush_at) flush();
  }
  void finish() {
    flush();
    file_.keep();
  }

 private:
  static constexpr std::size_t flush_at = std::size_t{1} << 16U;
  void flush() {
    file_.stream() << text_;
    text_.clear();
  }
  config::NewFile file_;
  std::string text_;
};

}  // namespace

int run_insert(const InsertOptions& options) {
  scene::Scene scene = scene::read_scene(options.scene);
  scene::require_insertion(scene);
  if (!options.method.empty()) scene.contact->method = method_of(options.method);
  const std::vector<Row> path = read_path(options.path);
  Lines rows(options.out,
             "t_s,x_m,y_m,theta_rad,tip_x_m,tip_y_m,tip_theta_rad,base_fx_n,base_fy_n,base_tau_nm,contacts,residual_n,pivots,solve_us");
  std::optional<Lines> contacts;
  if (!options.contacts_out.empty()) contacts.emplace(options.contacts_out, "step,contact,x_m,y_m,arclength_m,f_axial_n,f_lateral_n,state");

  const bool subdivide = scene.contact->method == contact::Method::Subdivide;
  if (subdivide && scene.contact->explicit_count > 0)
    throw config::UserError(fmt::format("{}: contact.method = \"subdivide\" cuts a path, and explicit points cut none; write \"embedded\"",
                                        scene.file.string()));
  Run run = subdivide ? subdivided(scene, options.path, path) : Run(scene, condense::plan(scene, condense::WithVisible::No));

  std::map<Status, std::pair<std::size_t, double>> trouble;  // rows, time of the first
  std::vector<double> solve_us;
  double residual = 0.0;
  std::uint32_t most_contacts = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Row& row = path[i];
    Status worst = Status::Ok;
    const auto begin = std::chrono::steady_clock::now();
    const Result r = run.advance(i, row, worst);
    const double us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
    if (worst == Status::OffShaft) throw config::UserError(fmt::format("{}: {}", scene.file.string(), off_shaft(scene, row.pose)));
    if (worst == Status::LeftCandidates) leaves_corridor(options.path, scene, row);
    if (worst != Status::Ok) {
      auto& entry = trouble.try_emplace(worst, 0, row.t_s).first->second;
      ++entry.first;
    }
    rows.add("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{},{:.17g},{},{:.3f}\n", row.t_s,
             row.pose.x_m, row.pose.y_m, row.pose.theta_rad, r.tip.x_m, r.tip.y_m, r.tip.theta_rad, r.base.fx_n, r.base.fy_n, r.base.tau_nm,
             r.contacts, r.residual_n, r.pivots, us);
    solve_us.push_back(us);
    residual = std::max(residual, r.residual_n);
    most_contacts = std::max(most_contacts, r.contacts);
    for (std::size_t k = 0; contacts && k < run.insertion().contacts(); ++k) {
      const Insertion::ContactReport c = run.insertion().contact(k);
      contacts->add("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{}\n", i, k, c.position_m[0], c.position_m[1], c.arclength_m, c.axial_n,
                    c.lateral_n, name_of(c.state));
    }
  }
  if (contacts) contacts->finish();
  rows.finish();

  for (const auto& [status, count] : trouble)
    fmt::print(stderr, "trocar: warning: {} of {} rows, first at t_s = {}: {}\n", count.first, path.size(), count.second,
               to_string(status));
  std::vector<double> sorted = solve_us;
  std::sort(sorted.begin(), sorted.end());
  const auto quantile = [&](double q) { return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))]; };
  if (options.json)
    fmt::print(
        "{{\"rows\": {}, \"contacts\": {}, \"residual_n\": {}, \"solve_us\": {{\"p50\": {:.3f}, \"p99\": {:.3f}, \"max\": {:.3f}}}, "
        "\"warnings\": {}}}\n",
        path.size(), most_contacts, residual, quantile(0.5), quantile(0.99), sorted.back(), trouble.size());
  else
    fmt::print("{} rows, at most {} contacts, residual at most {:.2g} N, a row took {:.1f} us (median; 99 %: {:.1f} us)\n", path.size(),
               most_contacts, residual, quantile(0.5), quantile(0.99));
  return 0;
}

}  // namespace trocar::cli
