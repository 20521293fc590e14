// The courses that contact solvers are driven along: a rigid needle 70 mm deep in the sheet of partner/sheet.hpp, contacts from the entry
// down to the tip, thresholds 34 N/m and twice that at the tip. Each solver drives its own copy, because what a contact slips is its own
// history.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "common/contact/solver.hpp"
#include "tests/benchmarks/partner/thesis_contact.hpp"
#include "tests/reference/rigid_needle.hpp"

namespace trocar::bench {

enum class Motion {
  TurnAndAdvance,  // every frame changes, all contacts slip
  TurnStuck,       // every frame changes, no contact slips
  TurnHalf,        // every frame changes, every second contact slips under a constant force
  Advance,         // straight, all slip: nothing is exchanged
  ToAndFro,        // straight, 8 mm to and fro: contacts stick and slip
  TurnToAndFro,    // both
  Rest             // the same pose
};

struct Scene {
  std::size_t contacts{};
  double entry_x_m{};
  double depth_m{0.07};
  Eigen::MatrixXd compliance{};                // 2 rows a contact, rig frame
  std::vector<std::array<double, 2>> point{};  // of the contacts at rest
};

class Course {
 public:
  Course(const Scene& scene, Motion motion);
  const std::vector<reference::Contact>& next();  // the targets of the next tick
  void slipped(std::size_t contact, double slip_m) { needle_.slipped(contact, slip_m); }
  [[nodiscard]] const reference::Contact& first_target(std::size_t contact) const { return needle_.target()[contact]; }
  [[nodiscard]] std::size_t contacts() const { return needle_.size(); }

 private:
  [[nodiscard]] reference::Pose pose(long tick) const;

  Motion motion_;
  double entry_x_m_;
  double depth_m_;
  reference::RigidNeedle needle_{};
  long tick_{};
};

[[nodiscard]] std::vector<contact::Block> our_row(const Eigen::MatrixXd& compliance, std::size_t contact);
[[nodiscard]] std::vector<Eigen::Matrix2d> thesis_row(const Eigen::MatrixXd& compliance, std::size_t contact);

// common/contact's solver on a course.
class Ours {
 public:
  Ours(const Scene& scene, Motion motion);
  double tick();             // seconds of the solve
  double tick_that_gains();  // the last contact leaves, and joins again: seconds of joining and solving
  [[nodiscard]] const contact::Solver& solver() const { return *solver_; }
  [[nodiscard]] double worst_residual_n() const { return worst_residual_n_; }
  [[nodiscard]] double slipping() const;  // share of the contacts
  [[nodiscard]] double pivots_per_tick() const { return ticks_ == 0 ? 0.0 : static_cast<double>(pivots_) / static_cast<double>(ticks_); }
  [[nodiscard]] const std::vector<reference::Contact>& targets() const { return *targets_; }
  [[nodiscard]] std::vector<reference::Axial> states() const;
  [[nodiscard]] Eigen::VectorXd force_n() const;

 private:
  void take(const std::vector<reference::Contact>& from);
  void finish(const contact::Solution& solution);

  Course course_;
  std::unique_ptr<contact::Solver> solver_{std::make_unique<contact::Solver>()};
  std::vector<contact::Target> target_{};
  const std::vector<reference::Contact>* targets_{};
  std::vector<contact::Block> last_row_{};
  double worst_residual_n_{};
  long pivots_{}, ticks_{};
};

// The thesis's algorithm on a course.
class Thesis {
 public:
  Thesis(const Scene& scene, Motion motion);
  double tick();
  double tick_that_gains();
  [[nodiscard]] const partner::ThesisContact& solver() const { return *solver_; }
  [[nodiscard]] double slipping() const;
  [[nodiscard]] Eigen::VectorXd force_n() const;
  [[nodiscard]] const std::vector<reference::Contact>& targets() const { return *targets_; }

 private:
  Course course_;
  std::unique_ptr<partner::ThesisContact> solver_{std::make_unique<partner::ThesisContact>()};
  const std::vector<reference::Contact>* targets_{};
  std::vector<Eigen::Matrix2d> last_row_{};
};

}  // namespace trocar::bench
