#include "common/insertion/insertion.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::insertion {
namespace {

double dot(const Vector2& a, const Vector2& b) noexcept { return a[0] * b[0] + a[1] * b[1]; }

Status worst(Status a, Status b) noexcept { return std::max(a, b); }

Status status_of(const contact::WorkingSet::Trouble& trouble) noexcept {
  if (trouble.tip_lost) return Status::TipLost;
  if (trouble.left_candidates) return Status::LeftCandidates;
  if (trouble.full) return Status::CapacityReached;
  return trouble.not_adapted ? Status::NotAdapted : Status::Ok;
}

Status status_of(contact::SolverStatus status) noexcept {
  switch (status) {
    case contact::SolverStatus::Ok:
      return Status::Ok;
    case contact::SolverStatus::PivotLimit:
      return Status::PivotLimit;
    case contact::SolverStatus::IllConditioned:
      return Status::IllConditioned;
    case contact::SolverStatus::NotFinite:
      break;
  }
  return Status::NotFinite;
}

}  // namespace

const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::Ok:
      return "ok";
    case Status::NotAdapted:
      return "a node could not be moved onto the needle and was pulled instead";
    case Status::CapacityReached:
      return "a contact is missing: the image allows no more";
    case Status::LeftCandidates:
      return "the needle left the candidate corridor";
    case Status::TipLost:
      return "the tip's place in the tissue was lost";
    case Status::IllConditioned:
      return "the residual stays above its tolerance";
    case Status::PivotLimit:
      return "the bound on pivots was hit";
    case Status::NotConverged:
      return "the bending needle found no equilibrium and was carried on rigidly";
    case Status::OffShaft:
      return "an explicit contact does not lie on the shaft";
    case Status::NotFinite:
      break;
  }
  return "an input is not a finite number";
}

void Insertion::open(const model::Image& image) noexcept {
  image_ = &image;
  set_.open(image.tissue, *image.law, image.needle.face_rad, image.needle.tip_lateral);
  density_.open(*image.law);
  bends_ = image.needle.elements > 0;
  if (bends_) flexible_.open(image.needle);
  reset();
}

void Insertion::reset() noexcept {
  set_.clear();
  if (bends_) flexible_.reset();
  started_ = false;
  speed_m_s_ = 0.0;
  shaft_n_per_m_ = density_.shaft_n_per_m(0.0);
  tip_n_per_m_ = density_.tip_n_per_m(0.0);
  result_ = {};
}

bool Insertion::place_explicit() noexcept {
  const contact::Law& law = *image_->law;
  const Vector2 base{pose_.x_m, pose_.y_m};
  for (std::size_t i = 0; i < law.explicit_count; ++i) {
    const Vector2 from_base{law.explicit_point_m[i][0] - base[0], law.explicit_point_m[i][1] - base[1]};
    double along = dot(axis_, from_base);
    double lateral = axis_[0] * from_base[1] - axis_[1] * from_base[0];
    if (bends_) {
      // Unloaded, but not straight where it has a curvature of its own.
      along = flexible_.arclength_m(law.explicit_point_m[i], along);
      const needle::Station at = flexible_.beam().at(along);
      lateral =
          at.tangent[0] * (law.explicit_point_m[i][1] - at.position_m[1]) - at.tangent[1] * (law.explicit_point_m[i][0] - at.position_m[0]);
    }
    const bool on_shaft = std::abs(lateral) <= explicit_point_tolerance_m && along >= -explicit_point_tolerance_m;
    if (!on_shaft || !set_.place(law.explicit_point_m[i])) {
      set_.clear();
      return false;
    }
  }
  return true;
}

// Anchors what is new, or was measured anew, where it now stands on the shaft.
void Insertion::anchor_fresh() noexcept {
  for (std::size_t i = 0; i < set_.size(); ++i) {
    contact::WorkingSet::Point& p = set_.point(i);
    if (!p.fresh) continue;
    p.fresh = false;
    // The tie's own softness counts as displacement, as it does in the solve.
    const Vector2 u = set_.tied_displacement_m(i);
    const Vector2 x{p.material_m[0] + u[0], p.material_m[1] + u[1]};
    p.arclength_m = dot(axis_, {x[0] - pose_.x_m, x[1] - pose_.y_m});
    if (bends_) p.arclength_m = flexible_.arclength_m(x, p.arclength_m);
  }
}

Wrench Insertion::base_wrench() const noexcept {
  Wrench wrench;
  for (std::size_t i = 0; i < set_.size(); ++i) {
    const Vector2& f = set_.solver().contact(i).force_n;
    const Vector2 u = set_.solver().displacement_m(i);
    const Vector2& x = set_.point(i).material_m;
    wrench.fx_n += f[0];
    wrench.fy_n += f[1];
    wrench.tau_nm += (x[0] + u[0] - pose_.x_m) * f[1] - (x[1] + u[1] - pose_.y_m) * f[0];
  }
  return wrench;
}

Insertion::ContactReport Insertion::contact(std::size_t i) const noexcept {
  const contact::Contact& c = set_.solver().contact(i);
  const Vector2 u = set_.solver().displacement_m(i);
  const contact::WorkingSet::Point& p = set_.point(i);
  ContactReport report{{p.material_m[0] + u[0], p.material_m[1] + u[1]}, p.arclength_m, c.axial_n, c.lateral_n, c.state};
  if (bends_) {
    // In the frame of the shaft as it stands, not as it stood when the contacts were solved.
    const double theta = flexible_.beam().theta_rad(i);
    report.axial_n = std::cos(theta) * c.force_n[0] + std::sin(theta) * c.force_n[1];
    report.lateral_n = std::cos(theta) * c.force_n[1] - std::sin(theta) * c.force_n[0];
  }
  return report;
}

Result Insertion::step(const Pose& base, double dt_s) noexcept {
  const bool timed = !started_ || (std::isfinite(dt_s) && dt_s > 0.0);
  if (!std::isfinite(base.x_m) || !std::isfinite(base.y_m) || !std::isfinite(base.theta_rad) || !timed) {
    result_.status = Status::NotFinite;
    result_.pivots = result_.iterations = result_.rows_factored = 0;
    return result_;
  }
  const contact::Law& law = *image_->law;
  Result result;
  // What the last solve did to the path. Done here, so that between two steps the contacts are those that carried the last result.
  if (law.explicit_count == 0 && set_.size() > 0) {
    result.status = status_of(set_.follow({tip_.x_m, tip_.y_m}, tip_axis_));
    anchor_fresh();
  }
  if (base.theta_rad != pose_.theta_rad || !started_) axis_ = {std::cos(base.theta_rad), std::sin(base.theta_rad)};
  if (started_ && density_.depends_on_speed()) {
    // Without a division by the time step, which may be next to nothing.
    const double way_m = dot(axis_, {base.x_m - pose_.x_m, base.y_m - pose_.y_m});
    const double speed = (speed_m_s_ * speed_filter_s + way_m) / (speed_filter_s + dt_s);
    if (std::isfinite(speed)) speed_m_s_ = speed;
    shaft_n_per_m_ = density_.shaft_n_per_m(std::abs(speed_m_s_));
    tip_n_per_m_ = density_.tip_n_per_m(std::abs(speed_m_s_));
  }
  const bool first = !started_;
  rests_ = started_ && base.x_m == pose_.x_m && base.y_m == pose_.y_m && base.theta_rad == pose_.theta_rad;
  pose_ = base;
  if (bends_ && set_.size() == 0 && !flexible_.free(base)) result.status = worst(result.status, Status::NotConverged);
  if (!bends_ || set_.size() == 0) take_tip();

  if (law.explicit_count > 0) {
    if (first && !place_explicit()) {
      result.status = Status::OffShaft;
      return result_ = result;
    }
    anchor_fresh();
  } else if (set_.size() == 0) {
    const Vector2 tip{tip_.x_m, tip_.y_m};
    if (set_.in_tissue(tip)) {
      result.status = worst(result.status, status_of(set_.enter(tip, tip_axis_, image_->needle.length_m)));
      anchor_fresh();
    }
  }
  started_ = true;

  if (set_.size() > 0 || !skip_) {
    if (set_.size() > 0) set_.soften_last(tip_axis_);
    set_.set_cutting(std::max(0.0, tip_n_per_m_ - shaft_n_per_m_));
    set_.set_bounds(shaft_n_per_m_, tip_n_per_m_, {target_.data(), set_.size()});
    if (bends_)
      solve_bending(result);
    else
      solve_rigid(result);
    result.base = base_wrench();
  }
  result.tip = tip_;
  result.contacts = static_cast<std::uint32_t>(set_.size());
  result.path_m = set_.path_m();
  return result_ = result;
}

bool Insertion::jacobian(Jacobian& out) noexcept {
  if (!started_ || result_.status != Status::Ok) return false;
  if (bends_) return flexible_.jacobian(pose_, set_, out);
  const double needle_m = image_->needle.length_m;
  out = {{{1.0, 0.0, -needle_m * axis_[1]}, {0.0, 1.0, needle_m * axis_[0]}, {0.0, 0.0, 1.0}}};
  return true;
}

void Insertion::take_tip() noexcept {
  if (bends_) {
    const needle::Station tip = flexible_.beam().tip();
    tip_ = {tip.position_m[0], tip.position_m[1], tip.theta_rad};
    tip_axis_ = tip.tangent;
  } else {
    const double needle_m = image_->needle.length_m;
    tip_ = {pose_.x_m + needle_m * axis_[0], pose_.y_m + needle_m * axis_[1], pose_.theta_rad};
    tip_axis_ = axis_;
  }
}

// Without forces the last solution is none, and the solver has to find it again.
void Insertion::release() noexcept {
  std::array<contact::Contact, capacity::contacts> free{};
  for (std::size_t i = 0; i < set_.size(); ++i) free[i].state = set_.solver().contact(i).state;
  set_.solver().assume({free.data(), set_.size()});
}

void Insertion::solve_rigid(Result& result) noexcept {
  const std::size_t n = set_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const contact::WorkingSet::Point& p = set_.point(i);
    target_[i].tangent = axis_;
    target_[i].gap_m = {pose_.x_m + p.arclength_m * axis_[0] - p.material_m[0], pose_.y_m + p.arclength_m * axis_[1] - p.material_m[1]};
  }
  if (!skip_) {
    set_.solver().forget_factor();
    set_.solver().forget_correction();
    if (rests_) release();
  }
  const contact::Solution solution = set_.solver().solve({target_.data(), n});
  result.status = worst(result.status, status_of(solution.status));
  result.pivots = solution.pivots;
  result.iterations = solution.iterations;
  result.rows_factored = solution.rows_factored;
  result.residual_n = solution.residual_n;
  for (std::size_t i = 0; i < n; ++i)
    if (set_.solver().contact(i).state != contact::State::Stuck) set_.point(i).arclength_m -= set_.solver().contact(i).slip_m;
}

void Insertion::solve_bending(Result& result) noexcept {
  const Flexible::Outcome outcome = flexible_.solve(pose_, set_, {target_.data(), set_.size()});
  result.status = worst(result.status, outcome.converged ? Status::Ok : Status::NotConverged);
  result.pivots = outcome.pivots;
  result.iterations = outcome.solves;
  result.newton = outcome.iterations;
  result.residual_n = outcome.residual_n;
  take_tip();
}

}  // namespace trocar::insertion
