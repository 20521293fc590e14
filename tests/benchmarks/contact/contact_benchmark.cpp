// Figures of the contact solver as ratios within one run: against one dense Cholesky of the same working matrix (the floor), against the
// thesis's algorithm, and against the whole sparse system. States are those of the exact solution for the latter, which favours it.
//   contact_benchmark [--out FOLDER] [--quick]
#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "tests/benchmarks/contact/course.hpp"
#include "tests/benchmarks/contact/output.hpp"
#include "tests/benchmarks/contact/timing.hpp"
#include "tests/benchmarks/contact/whole_step.hpp"
#include "tests/benchmarks/partner/full_system.hpp"
#include "tests/benchmarks/partner/sheet.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

using enum Ratio::Goal;

Scene scene_on(const partner::Sheet& sheet, std::size_t contacts, std::vector<int>* chosen = nullptr) {
  const std::vector<int> nodes = partner::axis_nodes(sheet, contacts);
  Scene scene;
  scene.contacts = contacts;
  scene.compliance = partner::compliance(sheet, nodes);
  for (const int node : nodes) {
    const fem::Point& at = sheet.mesh.node[static_cast<std::size_t>(node)];
    scene.point.push_back({at[0], at[1]});
  }
  scene.entry_x_m = scene.point.front()[0];
  if (chosen != nullptr) *chosen = nodes;
  return scene;
}

struct Case {
  const char* scene{};
  Motion motion{};
  double slipping_from{}, slipping_to{};  // share of slipping contacts that makes the row what its name says
};

constexpr Case cases[] = {{"turn_all_slip", Motion::TurnAndAdvance, 1.0, 1.0},
                          {"turn_all_stuck", Motion::TurnStuck, 0.0, 0.0},
                          {"turn_half", Motion::TurnHalf, 0.5, 0.5},
                          {"turn_to_and_fro", Motion::TurnToAndFro, 0.0, 1.0},
                          {"straight_advance", Motion::Advance, 1.0, 1.0},
                          {"straight_to_and_fro", Motion::ToAndFro, 0.0, 1.0},
                          {"rest", Motion::Rest, 0.0, 1.0}};

class Bench {
 public:
  explicit Bench(const Options& options) : options_(options) {}

  void contact_ticks();
  void whole_mesh();
  void sizes();
  void meshes();
  void skips();
  void errors();
  void finish();

 private:
  void add(const std::vector<Row>& rows, std::size_t contacts, std::size_t nodes);
  [[nodiscard]] double median(const std::string& scene, const std::string& method, std::size_t contacts = 32) const;

  Options options_;
  partner::Sheet sheet_{partner::make_sheet(100)};
  std::vector<int> nodes_{};
  Scene scene_{scene_on(sheet_, 32, &nodes_)};
  std::vector<Timing> timings_{};
  std::vector<Error> errors_{};
  std::vector<Ratio> ratios_{};
};

Row floor_row(const Scene& scene) {
  auto llt = std::make_shared<Eigen::LLT<Eigen::MatrixXd>>(scene.compliance);
  return {"floor/dense_cholesky", [llt, &scene] { return timed([&] { llt->compute(scene.compliance); }); }};
}

template <class Solver>
Row course_row(const std::string& name, const std::shared_ptr<Solver>& solver) {
  return {name, [solver] { return solver->tick(); }};
}

// Rows are named scene/method.
void Bench::add(const std::vector<Row>& rows, std::size_t contacts, std::size_t nodes) {
  for (const Row& row : rows) {
    const std::size_t slash = row.name.find('/');
    timings_.push_back(
        {row.name.substr(0, slash), row.name.substr(slash + 1), contacts, nodes, row.median_s, row.quartile_s[0], row.quartile_s[1]});
  }
}

double Bench::median(const std::string& scene, const std::string& method, std::size_t contacts) const {
  for (const Timing& t : timings_)
    if (t.scene == scene && t.method == method && t.contacts == contacts) return t.median_s;
  throw std::logic_error("no row " + scene + "/" + method);
}

void Bench::contact_ticks() {
  std::vector<Row> rows{floor_row(scene_)};
  std::vector<std::pair<const Case*, std::shared_ptr<Ours>>> watched;
  for (const Case& each : cases) {
    watched.emplace_back(&each, std::make_shared<Ours>(scene_, each.motion));
    rows.push_back(course_row(std::string(each.scene) + "/ours", watched.back().second));
    rows.push_back(course_row(std::string(each.scene) + "/thesis", std::make_shared<Thesis>(scene_, each.motion)));
  }
  const auto ours = std::make_shared<Ours>(scene_, Motion::TurnAndAdvance);
  const auto thesis = std::make_shared<Thesis>(scene_, Motion::TurnAndAdvance);
  rows.push_back({"gains_a_contact/ours", [ours] { return ours->tick_that_gains(); }});
  rows.push_back({"gains_a_contact/thesis", [thesis] { return thesis->tick_that_gains(); }});
  measure(rows, options_.turns(41));
  add(rows, 32, sheet_.mesh.node.size());
  for (const auto& [each, solver] : watched)
    if (solver->slipping() < each->slipping_from || solver->slipping() > each->slipping_to)
      throw std::runtime_error(
          fmt::format("the scene {} is not what its name says: {:.0f} % slip", each->scene, 100.0 * solver->slipping()));

  const double floor = median("floor", "dense_cholesky");
  for (const char* scene : {"turn_all_slip", "turn_all_stuck", "turn_half", "turn_to_and_fro"}) {
    ratios_.push_back({fmt::format("{}: ours / floor", scene), median(scene, "ours") / floor, AtMost, 3.0});
    // A stuck contact's frame costs the thesis O(m), a slipping one's O(m^2): the goal is for insertion, where contacts slip.
    const bool all_slip = std::strcmp(scene, "turn_all_slip") == 0;
    ratios_.push_back(
        {fmt::format("{}: thesis / ours", scene), median(scene, "thesis") / median(scene, "ours"), all_slip ? AtLeast : None, 5.0});
  }
  for (const char* scene : {"straight_advance", "straight_to_and_fro"})
    ratios_.push_back({fmt::format("{}: ours / thesis", scene), median(scene, "ours") / median(scene, "thesis"), AtMost, 2.0});
  ratios_.push_back({"gains_a_contact: ours / floor", median("gains_a_contact", "ours") / floor, None, 0.0});
  ratios_.push_back({"rest: ours / floor", median("rest", "ours") / floor, AtMost, 0.2});
}

// One exact tick after the other; the whole-mesh methods solve the same targets with the same states.
struct Driver {
  explicit Driver(const Scene& scene, Motion motion) : exact(scene, motion) {}
  Ours exact;
  std::vector<reference::Axial> state{};
  void next() {
    exact.tick();
    state = exact.states();
  }
};

std::vector<Row> whole_mesh_rows(const std::string& scene_name, const Scene& scene, const partner::Sheet& sheet,
                                 std::span<const int> nodes) {
  const std::vector<partner::ContactNode> contact = partner::contact_nodes(sheet, nodes);
  const auto reused = std::make_shared<partner::ReusedFactor>(sheet.stiffness, contact);
  const auto refactored = std::make_shared<partner::RefactoredSystem>(sheet.stiffness, contact);
  const auto row = [&](const char* method, int ticks, auto work) {
    const auto driver = std::make_shared<Driver>(scene, Motion::TurnAndAdvance);
    return Row{scene_name + "/" + method,
               [driver, work] {
                 driver->next();
                 return timed([&] { work(driver->exact.targets(), driver->state); });
               },
               ticks};
  };
  using Targets = const std::vector<reference::Contact>&;
  using States = const std::vector<reference::Axial>&;
  return {row("full_displacement", 4, [reused](Targets, States) { reused->displace(); }),
          row("full_reused_columns", 1, [reused](Targets t, States s) { reused->solve_by_columns(t, s); }),
          row("full_reused_iterations", 2, [reused](Targets t, States s) { reused->solve_by_iterations(t, s); }),
          row("full_refactored", 1, [refactored](Targets t, States s) { refactored->solve(t, s); })};
}

void Bench::whole_mesh() {
  std::vector<Row> rows = whole_mesh_rows("whole_mesh", scene_, sheet_, nodes_);
  rows.push_back(course_row("whole_mesh/ours", std::make_shared<Ours>(scene_, Motion::TurnAndAdvance)));
  measure(rows, options_.turns(11));
  add(rows, 32, sheet_.mesh.node.size());
  const double ours = median("whole_mesh", "ours");
  const double reused = std::min(median("whole_mesh", "full_reused_columns"), median("whole_mesh", "full_reused_iterations"));
  ratios_.push_back({"10,000 nodes: one solve with the sparse factor / ours", median("whole_mesh", "full_displacement") / ours, None, 0.0});
  ratios_.push_back({"10,000 nodes: sparse system with its factor reused / ours", reused / ours, AtLeast, 100.0});
  ratios_.push_back({"10,000 nodes: sparse system refactored / ours", median("whole_mesh", "full_refactored") / ours, AtLeast, 1500.0});
}

void Bench::sizes() {
  const std::size_t sizes[] = {4, 8, 16, 32, 64};
  std::vector<std::unique_ptr<Scene>> scenes;
  for (const std::size_t s : sizes) {
    scenes.push_back(std::make_unique<Scene>(scene_on(sheet_, s)));
    const Scene& scene = *scenes.back();
    std::vector<Row> rows{floor_row(scene)};
    rows[0].name = "contacts_floor/dense_cholesky";
    for (const auto& [name, motion] : {std::pair{"contacts_turn", Motion::TurnAndAdvance}, std::pair{"contacts_warm", Motion::ToAndFro}}) {
      rows.push_back(course_row(std::string(name) + "/ours", std::make_shared<Ours>(scene, motion)));
      rows.push_back(course_row(std::string(name) + "/thesis", std::make_shared<Thesis>(scene, motion)));
    }
    measure(rows, options_.turns(15));
    add(rows, s, sheet_.mesh.node.size());
  }
  for (const char* scene : {"contacts_turn", "contacts_warm"}) {
    const double exponent = std::log2(median(scene, "ours", 64) / median(scene, "ours", 8)) / 3.0;
    const bool warm = std::strcmp(scene, "contacts_warm") == 0;
    ratios_.push_back({fmt::format("{}: exponent over 8 to 64 contacts", scene), exponent, warm ? AtMost : None, 2.0});
  }
}

void Bench::meshes() {
  constexpr std::size_t few = 14;  // as many as the coarsest mesh has nodes on the needle
  std::vector<Row> light;
  std::vector<std::size_t> nodes_of, contacts_of;
  std::vector<std::shared_ptr<WholeStep>> steps;
  for (const int side : {21, 32, 45, 71, 100, 150, 224}) {
    const partner::Sheet sheet = partner::make_sheet(side);
    const std::size_t mesh_nodes = sheet.mesh.node.size();
    std::vector<int> nodes;
    const Scene scene = scene_on(sheet, few, &nodes);
    std::vector<Row> rows = whole_mesh_rows("mesh_size", scene, sheet, nodes);
    measure(rows, options_.turns(5));
    add(rows, few, mesh_nodes);
    const auto light_row = [&](const Row& row, std::size_t contacts) {
      light.push_back(row);
      nodes_of.push_back(mesh_nodes);
      contacts_of.push_back(contacts);
    };
    light_row(course_row("mesh_size/ours", std::make_shared<Ours>(scene, Motion::TurnAndAdvance)), few);
    light_row(course_row("mesh_size/thesis", std::make_shared<Thesis>(scene, Motion::TurnAndAdvance)), few);
    steps.push_back(std::make_shared<WholeStep>(side, 32, WholeStep::Motion::Turn));
    light_row(course_row("mesh_size/our_whole_step", steps.back()), 32);
  }
  measure(light, options_.turns(41));
  std::vector<double> step_s;
  for (std::size_t k = 0; k < light.size(); ++k) {
    add({light[k]}, contacts_of[k], nodes_of[k]);
    if (contacts_of[k] == 32) step_s.push_back(light[k].median_s);
  }
  const auto [least, most] = std::minmax_element(step_s.begin(), step_s.end());
  ratios_.push_back({"441 to 50,176 nodes, whole step, 32 contacts: dearest / cheapest", *most / *least, AtMost, 1.2});
  for (std::size_t k = 0; k < steps.size(); ++k)
    fmt::print(stderr, "  whole step on {} nodes: {} contacts, {:.0f} % slip\n", nodes_of[3 * k], steps[k]->contacts(),
               100.0 * steps[k]->slipping());
}

// What each skip saves: needle outside of the tissue, nothing changed, factor used again. That it changes no result is a test of
// common/insertion.
void Bench::skips() {
  using Motion = WholeStep::Motion;
  std::vector<Row> rows;
  const auto row = [&](const char* name, Motion motion, bool skip) {
    rows.push_back(course_row(name, std::make_shared<WholeStep>(71, 32, motion, skip)));
  };
  row("skips/outside", Motion::Outside, true);
  row("skips/rest", Motion::Rest, true);
  row("skips/straight", Motion::ToAndFro, true);
  row("skips/straight_factor_anew", Motion::ToAndFro, false);
  row("skips/turn", Motion::Turn, true);
  row("skips/turn_factor_anew", Motion::Turn, false);
  measure(rows, options_.turns(21));
  add(rows, 32, 71 * 71);
  const auto ratio = [&](const char* what, const char* with, const char* without) {
    ratios_.push_back({what, median("skips", with) / median("skips", without), None, 0.0});
  };
  ratio("whole step, needle outside of the tissue / turning", "outside", "turn");
  ratio("whole step, at rest / turning", "rest", "turn");
  ratio("whole step, straight: factor reused / anew", "straight", "straight_factor_anew");
  ratio("whole step, turning: stuck rows of the factor reused / anew", "turn", "turn_factor_anew");
}

// The exact solution along a course of its own, tick by tick, by the reference.
class Exact {
 public:
  Exact(const Scene& scene, Motion motion) : course_(scene, motion), scene_(&scene) {}
  Eigen::VectorXd next() {
    const reference::BoxQp qp{scene_->compliance, course_.next()};
    const reference::Solution found = reference::projected_gauss_seidel(qp, 1e-11);
    if (!found.solved) throw std::runtime_error("the reference did not converge");
    const Eigen::VectorXd u = qp.compliance_m_per_n * found.force_n;
    for (std::size_t i = 0; i < qp.contact.size(); ++i) {
      const reference::Contact& c = qp.contact[i];
      const auto k = static_cast<Eigen::Index>(2 * i);
      if (found.state[i] != reference::Axial::Stuck)
        course_.slipped(i, c.tangent[0] * (c.gap_m[0] - u(k)) + c.tangent[1] * (c.gap_m[1] - u(k + 1)));
    }
    return found.force_n;
  }

 private:
  Course course_;
  const Scene* scene_;
};

void Bench::errors() {
  const int ticks = options_.quick ? 100 : 1000;
  const std::vector<partner::ContactNode> contact = partner::contact_nodes(sheet_, nodes_);
  for (const auto& [name, motion] :
       {std::pair{"turn_to_and_fro", Motion::TurnToAndFro}, std::pair{"straight_to_and_fro", Motion::ToAndFro}}) {
    Exact exact(scene_, motion);
    std::vector<Eigen::VectorXd> force;
    std::vector<std::vector<reference::Contact>> target;
    Ours ours(scene_, motion);  // its constructor went through the first ticks
    Thesis thesis(scene_, motion);
    for (int k = 0; k < 400; ++k) exact.next();
    Error our_error{name, "ours", 0.0, 0.0, median(name, "ours")}, thesis_error{name, "thesis", 0.0, 0.0, median(name, "thesis")};
    const auto count = [](Error& error, const Eigen::VectorXd& f, const Eigen::VectorXd& right) {
      const Eigen::VectorXd wrong = f - right;
      error.worst_force_n = std::max(error.worst_force_n, wrong.lpNorm<Eigen::Infinity>());
      const Eigen::Map<const Eigen::Matrix2Xd> each(wrong.data(), 2, wrong.size() / 2);
      error.worst_base_force_n = std::max(error.worst_base_force_n, each.rowwise().sum().norm());
    };
    for (int k = 0; k < ticks; ++k) {
      const Eigen::VectorXd right = exact.next();
      ours.tick();
      thesis.tick();
      count(our_error, ours.force_n(), right);
      count(thesis_error, thesis.force_n(), right);
    }
    errors_.push_back(our_error);
    errors_.push_back(thesis_error);
    if (motion != Motion::TurnToAndFro) continue;
    partner::ReusedFactor reused(sheet_.stiffness, contact);
    partner::RefactoredSystem refactored(sheet_.stiffness, contact);
    Driver driver(scene_, motion);
    Error by[] = {{name, "full_refactored", 0.0, 0.0, median("whole_mesh", "full_refactored")},
                  {name, "full_reused_columns", 0.0, 0.0, median("whole_mesh", "full_reused_columns")},
                  {name, "full_reused_iterations", 0.0, 0.0, median("whole_mesh", "full_reused_iterations")}};
    for (int k = 0; k < 20; ++k) {
      driver.next();
      const Eigen::VectorXd right = reference::solve_with_states({scene_.compliance, driver.exact.targets()}, driver.state).force_n;
      refactored.solve(driver.exact.targets(), driver.state);
      count(by[0], refactored.force_n(), right);
      reused.solve_by_columns(driver.exact.targets(), driver.state);
      count(by[1], reused.force_n(), right);
      reused.solve_by_iterations(driver.exact.targets(), driver.state);
      count(by[2], reused.force_n(), right);
    }
    errors_.insert(errors_.end(), std::begin(by), std::end(by));
  }
}

void Bench::finish() {
  print(timings_);
  print(errors_);
  print(ratios_);
  write(options_.out, timings_, errors_);
  fmt::print("\ntables and figures: {}\n", options_.out.string());
}

int run(const Options& options) {
  Bench bench(options);
  const auto step = [](const char* what, const std::function<void()>& work) { bench::step("contact_benchmark", what, work); };
  step("ticks at 32 contacts", [&] { bench.contact_ticks(); });
  step("the whole mesh, 10,000 nodes", [&] { bench.whole_mesh(); });
  step("4 to 64 contacts", [&] { bench.sizes(); });
  step("441 to 50,176 nodes", [&] { bench.meshes(); });
  step("what skipping saves", [&] { bench.skips(); });
  step("errors", [&] { bench.errors(); });
  bench.finish();
  return 0;
}

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program("contact_benchmark", count, argument, trocar::bench::run); }
