#include "tests/benchmarks/partner/full_system.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace trocar::partner {
namespace {

using reference::Axial;
using Target = reference::Contact;

Eigen::Matrix2d frame(const Target& target) {
  return Eigen::Matrix2d{{target.tangent[0], target.tangent[1]}, {-target.tangent[1], target.tangent[0]}};
}
Eigen::Vector2d gap(const Target& target) { return {target.gap_m[0], target.gap_m[1]}; }
double bound(const Target& target, Axial state) { return state == Axial::Upper ? target.upper_n : target.lower_n; }

std::vector<int> contact_of_row(Eigen::Index rows, const std::vector<ContactNode>& contact) {
  std::vector<int> of(static_cast<std::size_t>(rows), -1);
  for (std::size_t i = 0; i < contact.size(); ++i)
    for (const int row : {contact[i].x_row, contact[i].y_row}) {
      if (row < 0 || row >= rows) throw std::runtime_error("a contact node is supported");
      of[static_cast<std::size_t>(row)] = static_cast<int>(i);
    }
  return of;
}

}  // namespace

RefactoredSystem::RefactoredSystem(const Eigen::SparseMatrix<double>& stiffness, std::vector<ContactNode> contact)
    : stiffness_(stiffness), contact_(std::move(contact)), entry_(contact_.size()), cholesky_(stiffness) {
  using Iterator = Eigen::SparseMatrix<double>::InnerIterator;
  const std::vector<int> contact_at = contact_of_row(stiffness.rows(), contact_);
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    const ContactNode& own = contact_[i];
    Iterator x(stiffness_, own.x_row), y(stiffness_, own.y_row);
    std::vector<bool> paired(contact_.size());
    for (; x && y; ++x, ++y) {
      const auto row = static_cast<int>(x.row());
      if (y.row() != x.row()) break;
      const int other = contact_at[static_cast<std::size_t>(row)];
      if (other < 0) {
        entry_[i].push_back({row, x.value(), y.value(), cholesky_.slot(row, own.x_row), cholesky_.slot(row, own.y_row)});
        continue;
      }
      const auto j = static_cast<std::size_t>(other);
      if (j > i || paired[j]) continue;
      paired[j] = true;
      Pair pair{i, j, {}, {}};
      const std::array<int, 2> rows{own.x_row, own.y_row}, columns{contact_[j].x_row, contact_[j].y_row};
      for (std::size_t a = 0; a < 2; ++a)
        for (std::size_t b = 0; b < 2; ++b) {
          pair.k(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = stiffness_.coeff(rows[a], columns[b]);
          pair.slot[a][b] = cholesky_.slot(rows[a], columns[b]);
        }
      pair_.push_back(pair);
    }
    if (x || y) throw std::runtime_error("the two columns of a contact node differ in pattern");
  }
  b_.resize(stiffness.rows());
  u_.resize(stiffness.rows());
  force_.resize(static_cast<Eigen::Index>(2 * contact_.size()));
}

void RefactoredSystem::solve(std::span<const Target> target, std::span<const Axial> state) {
  double* const value = cholesky_.values();
  b_.setZero();
  const auto known = [&](std::size_t i, std::size_t component) { return component == 1 || state[i] == Axial::Stuck; };
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    const Eigen::Matrix2d r = frame(target[i]);
    const Eigen::Vector2d d = r * gap(target[i]);
    const bool stuck = state[i] == Axial::Stuck;
    if (!stuck) b_(contact_[i].x_row) += bound(target[i], state[i]);
    for (const Entry& e : entry_[i]) {
      const double axial = r(0, 0) * e.kx + r(0, 1) * e.ky, lateral = r(1, 0) * e.kx + r(1, 1) * e.ky;
      value[e.lateral_slot] = 0.0;
      value[e.axial_slot] = stuck ? 0.0 : axial;
      b_(e.row) -= lateral * d(1) + (stuck ? axial * d(0) : 0.0);
    }
  }
  for (const Pair& p : pair_) {
    const Eigen::Matrix2d k = frame(target[p.i]) * p.k * frame(target[p.j]).transpose();
    const Eigen::Vector2d di = frame(target[p.i]) * gap(target[p.i]), dj = frame(target[p.j]) * gap(target[p.j]);
    for (std::size_t a = 0; a < 2; ++a)
      for (std::size_t b = 0; b < 2; ++b) {
        const auto ai = static_cast<Eigen::Index>(a), bi = static_cast<Eigen::Index>(b);
        const bool row_known = known(p.i, a), column_known = known(p.j, b);
        const int row = a == 0 ? contact_[p.i].x_row : contact_[p.i].y_row, column = b == 0 ? contact_[p.j].x_row : contact_[p.j].y_row;
        if (row == column) {
          value[p.slot[a][b]] = k(ai, ai);  // as large as its neighbours, so that eliminated rows do not spoil the scaling
          continue;
        }
        value[p.slot[a][b]] = row_known || column_known ? 0.0 : k(ai, bi);
        if (column_known && !row_known) b_(row) -= k(ai, bi) * dj(bi);
        if (p.i != p.j && row_known && !column_known) b_(column) -= k(ai, bi) * di(ai);
      }
  }
  // Known rows hold their displacement alone: what other contacts' entries left there does not count.
  for (const Pair& p : pair_) {
    if (p.i != p.j) continue;
    const Eigen::Matrix2d r = frame(target[p.i]);
    const Eigen::Vector2d d = r * gap(target[p.i]);
    if (known(p.i, 0)) b_(contact_[p.i].x_row) = value[p.slot[0][0]] * d(0);
    b_(contact_[p.i].y_row) = value[p.slot[1][1]] * d(1);
  }
  cholesky_.factor();
  u_ = cholesky_.solve(b_);
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    const Eigen::Vector2d rig = frame(target[i]).transpose() * Eigen::Vector2d(u_(contact_[i].x_row), u_(contact_[i].y_row));
    u_(contact_[i].x_row) = rig.x();
    u_(contact_[i].y_row) = rig.y();
  }
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    force_(static_cast<Eigen::Index>(2 * i)) = stiffness_.col(contact_[i].x_row).dot(u_);
    force_(static_cast<Eigen::Index>(2 * i + 1)) = stiffness_.col(contact_[i].y_row).dot(u_);
  }
}

ReusedFactor::ReusedFactor(const Eigen::SparseMatrix<double>& stiffness, std::vector<ContactNode> contact)
    : contact_(std::move(contact)), cholesky_(stiffness) {
  static_cast<void>(contact_of_row(stiffness.rows(), contact_));
  cholesky_.factor();
  const auto m = static_cast<Eigen::Index>(2 * contact_.size());
  contact_stiffness_.resize(m, m);
  const auto row = [&](Eigen::Index k) {
    const ContactNode& at = contact_[static_cast<std::size_t>(k / 2)];
    return k % 2 == 0 ? at.x_row : at.y_row;
  };
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < m; ++j) contact_stiffness_(i, j) = stiffness.coeff(row(i), row(j));
  b_.setZero(stiffness.rows());
  u_.setZero(stiffness.rows());
  force_.setZero(m);
  bounded_.setZero(m);
}

void ReusedFactor::constrain(std::span<const Target> target, std::span<const Axial> state) {
  constraint_.clear();
  owner_.clear();
  bounded_.setZero();
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    const Eigen::Vector2d t = frame(target[i]).row(0), n = frame(target[i]).row(1);
    if (state[i] == Axial::Stuck) {
      constraint_.push_back({contact_[i], t, t.dot(gap(target[i]))});
      owner_.push_back(i);
    } else {
      bounded_.segment<2>(static_cast<Eigen::Index>(2 * i)) = bound(target[i], state[i]) * t;
    }
    constraint_.push_back({contact_[i], n, n.dot(gap(target[i]))});
    owner_.push_back(i);
  }
}

void ReusedFactor::load(const Eigen::VectorXd& multiplier, bool with_bounds) {
  b_.setZero();
  for (std::size_t k = 0; k < constraint_.size(); ++k) {
    const Constraint& c = constraint_[k];
    b_(c.at.x_row) += multiplier(static_cast<Eigen::Index>(k)) * c.direction.x();
    b_(c.at.y_row) += multiplier(static_cast<Eigen::Index>(k)) * c.direction.y();
  }
  if (!with_bounds) return;
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    b_(contact_[i].x_row) += bounded_(static_cast<Eigen::Index>(2 * i));
    b_(contact_[i].y_row) += bounded_(static_cast<Eigen::Index>(2 * i + 1));
  }
}

Eigen::VectorXd ReusedFactor::component(const Eigen::Ref<const Eigen::VectorXd>& u) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(constraint_.size()));
  for (std::size_t k = 0; k < constraint_.size(); ++k) {
    const Constraint& c = constraint_[k];
    out(static_cast<Eigen::Index>(k)) = c.direction.x() * u(c.at.x_row) + c.direction.y() * u(c.at.y_row);
  }
  return out;
}

void ReusedFactor::take_forces(const Eigen::VectorXd& multiplier) {
  force_ = bounded_;
  for (std::size_t k = 0; k < constraint_.size(); ++k)
    force_.segment<2>(static_cast<Eigen::Index>(2 * owner_[k])) += multiplier(static_cast<Eigen::Index>(k)) * constraint_[k].direction;
}

void ReusedFactor::solve_by_columns(std::span<const Target> target, std::span<const Axial> state) {
  constrain(target, state);
  const auto count = static_cast<Eigen::Index>(constraint_.size());
  columns_.setZero(cholesky_.rows(), count + 1);  // the last one: the slipping contacts' known forces
  Eigen::VectorXd rest(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Constraint& c = constraint_[static_cast<std::size_t>(k)];
    columns_(c.at.x_row, k) = c.direction.x();
    columns_(c.at.y_row, k) = c.direction.y();
    rest(k) = c.gap_m;
  }
  load(Eigen::VectorXd::Zero(count), true);
  columns_.col(count) = b_;
  const auto solved = cholesky_.solve(columns_);
  Eigen::MatrixXd compliance(count, count);
  for (Eigen::Index k = 0; k < count; ++k) compliance.col(k) = component(solved.col(k));
  const Eigen::VectorXd multiplier = compliance.llt().solve(Eigen::VectorXd(rest - component(solved.col(count))));
  u_.noalias() = solved.leftCols(count) * multiplier;
  u_ += solved.col(count);
  take_forces(multiplier);
}

int ReusedFactor::solve_by_iterations(std::span<const Target> target, std::span<const Axial> state, double tolerance) {
  constrain(target, state);
  const auto count = static_cast<Eigen::Index>(constraint_.size());
  Eigen::VectorXd multiplier(count), goal(count);
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(force_.size(), count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& c = constraint_[static_cast<std::size_t>(k)];
    const auto first = static_cast<Eigen::Index>(2 * owner_[static_cast<std::size_t>(k)]);
    multiplier(k) = c.direction.dot(force_.segment<2>(first));  // where the last tick ended
    directions.col(k).segment<2>(first) = c.direction;
    goal(k) = c.gap_m;
  }
  const Eigen::MatrixXd preconditioner = directions.transpose() * contact_stiffness_ * directions;
  load(multiplier, true);
  u_ = cholesky_.solve(b_);
  Eigen::VectorXd r = goal - component(u_);
  const double enough = tolerance * goal.norm();
  int iterations = 0;
  if (r.norm() > enough) {
    Eigen::VectorXd z = preconditioner * r, p = z;
    double rz = r.dot(z);
    for (; iterations < 200;) {
      load(p, false);
      const auto step = cholesky_.solve(b_);
      ++iterations;
      const Eigen::VectorXd q = component(step.col(0));
      const double length = rz / p.dot(q);
      multiplier += length * p;
      u_ += length * step.col(0);
      r -= length * q;
      if (r.norm() <= enough) break;
      z.noalias() = preconditioner * r;
      const double next = r.dot(z);
      p = z + (next / rz) * p;
      rz = next;
    }
  }
  take_forces(multiplier);
  return iterations;
}

void ReusedFactor::displace() {
  b_.setZero();
  for (std::size_t i = 0; i < contact_.size(); ++i) {
    b_(contact_[i].x_row) = force_(static_cast<Eigen::Index>(2 * i));
    b_(contact_[i].y_row) = force_(static_cast<Eigen::Index>(2 * i + 1));
  }
  u_ = cholesky_.solve(b_);
}

}  // namespace trocar::partner
