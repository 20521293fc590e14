// The plain ways to the same forces: the whole sparse system with the contacts' constraints, every tick. Contacts are nodes of the mesh.
//   K u = f          all unsupported degrees of freedom; on a contact, in its frame (t, n):
//   lateral          n.u = n.d, always            axial   stuck: t.u = t.d;  slipping: t.f = bound
// Refactored: the contacts' degrees of freedom are rotated into their frames and the known displacements eliminated; one numeric
//   factorisation and one solve. Eliminated rows stay in the pattern as a diagonal entry, so that the symbolic analysis is made once.
// Reused: K is factored once. The unknown contact forces l follow from C K^-1 C' l = rest, C picking the constrained components, without
//   anything about the tissue kept from one tick to the next but the factor (keeping K^-1 C' is condensation, which is the method that
//   these are compared with). Two ways to it:
//     columns     K^-1 C' by one blocked solve, then a dense Cholesky
//     iterations  conjugate gradients on the forces, one solve with the factor each, from the last tick's forces, with C K C' for a
//                 preconditioner (the lumped one of the FETI methods)
// States are given: a tick here is one linear solve, which favours these partners.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <span>
#include <vector>

#include "tests/benchmarks/partner/sparse_cholesky.hpp"
#include "tests/reference/box_qp.hpp"

namespace trocar::partner {

struct ContactNode {
  int x_row{}, y_row{};  // of the unsupported system
};

class RefactoredSystem {
 public:
  // `stiffness`: N/m, unsupported rows and columns, both triangles; a contact's two columns must have the same pattern (elements give
  // them that). Throws std::runtime_error otherwise.
  RefactoredSystem(const Eigen::SparseMatrix<double>& stiffness, std::vector<ContactNode> contact);
  void solve(std::span<const reference::Contact> target, std::span<const reference::Axial> state);

  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return u_; }  // of all rows, rig frame
  [[nodiscard]] const Eigen::VectorXd& force_n() const { return force_; }     // of the contacts, 2 rows each, rig frame
  [[nodiscard]] double factor_nonzeros() const { return cholesky_.factor_nonzeros(); }

 private:
  struct Entry {  // couples a contact with a row that belongs to none
    int row{};
    double kx{}, ky{};
    int axial_slot{}, lateral_slot{};
  };
  struct Pair {  // couples contact i with contact j <= i
    std::size_t i{}, j{};
    Eigen::Matrix2d k{};
    std::array<std::array<int, 2>, 2> slot{};
  };
  Eigen::SparseMatrix<double> stiffness_{};
  std::vector<ContactNode> contact_{};
  std::vector<std::vector<Entry>> entry_{};
  std::vector<Pair> pair_{};
  SparseCholesky cholesky_;
  Eigen::VectorXd b_{}, u_{}, force_{};
};

class ReusedFactor {
 public:
  ReusedFactor(const Eigen::SparseMatrix<double>& stiffness, std::vector<ContactNode> contact);
  void solve_by_columns(std::span<const reference::Contact> target, std::span<const reference::Axial> state);
  // Until the gap's residual is below `tolerance` of what it is without constrained forces. Returns the iterations.
  int solve_by_iterations(std::span<const reference::Contact> target, std::span<const reference::Axial> state, double tolerance = 1e-10);
  // The displacement of everything under the contact forces as they are: the least that a method can do that looks at the whole mesh.
  void displace();

  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return u_; }
  [[nodiscard]] const Eigen::VectorXd& force_n() const { return force_; }

 private:
  struct Constraint {  // one component of C: direction at a contact, and the displacement it must have
    ContactNode at{};
    Eigen::Vector2d direction{};
    double gap_m{};
  };
  void constrain(std::span<const reference::Contact> target, std::span<const reference::Axial> state);
  void load(const Eigen::VectorXd& multiplier, bool with_bounds);  // b = C' multiplier [+ bounds of slipping contacts]
  [[nodiscard]] Eigen::VectorXd component(const Eigen::Ref<const Eigen::VectorXd>& u) const;  // C u
  void take_forces(const Eigen::VectorXd& multiplier);

  std::vector<ContactNode> contact_{};
  SparseCholesky cholesky_;
  Eigen::MatrixXd contact_stiffness_{};  // rows and columns of K at the contacts
  std::vector<Constraint> constraint_{};
  std::vector<std::size_t> owner_{};  // of each constraint
  Eigen::VectorXd bounded_{};         // forces of slipping contacts, rig frame, 2 rows a contact
  Eigen::VectorXd b_{}, u_{}, force_{};
  Eigen::MatrixXd columns_{};
};

}  // namespace trocar::partner
