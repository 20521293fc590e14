// The needle of DiMaio's thesis (section 5.5, appendix C), for comparison: plane stress triangles with Green-Lagrange strain, 16 x 4 nodes
// in print, clamped at its base and bent by dead forces. Offline; the needle that inserts is common/needle/beam.hpp.
//
//   Nodes (i, j), i along the needle (x) from the clamp, j across its depth (y); number 4 i + j, so that stiffness has 11 subdiagonals.
//   Each rectangle is cut from lower left to upper right. A force at arclength s acts on the mid-line: between two stations i in
//   proportion, half on either inner node of each. The mid-line's position at s is its mean over the same nodes. f_int(u) = K0 u + f_q(u)
//   is the derivative of the strain energy (St. Venant-Kirchhoff, element.hpp), K(u) its tangent.
//     fixed point (5.11)   u <- K0^-1 (f - f_q(u)) = u + K0^-1 (f - f_int(u)), from u = 0
//     Newton               K du = f - f_int(u), u <- u + du, from u = 0; the load in one step, halved where that fails
//   Full Newton steps: with the exact line search of nonlinear.hpp the 5.13 case takes 9 to 18 of them, without it 5 to 10, because along
//   du the axial strain of a slender needle grows as s^2 and the energy stops the step early. They become 4 to 6 when the stress in the
//   geometric part of K is the one which the last step predicted, C (E(u) + E'(u) du), instead of C E(u + du); both agree at equilibrium.
//   Magisano, Leonetti, Garcea, Advantages of the mixed format in geometrically nonlinear analysis, IJNME 109 (2017) 1237.
//
// Three linear triangles across lock in bending: the modulus is an effective one. Printed: 980 MPa. Depth and thickness are not printed;
// with both the tube's outer diameter, 674 MPa has the small-load compliance of a 20G steel tube. What solve and factor need is allocated
// once.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace trocar::fem {

struct ThesisNeedleProperties {
  double length_m{};
  double depth_m{};      // in the plane, across the needle
  double thickness_m{};  // out of the plane
  double young_pa{980e6};
  double poisson{0.3};
  int elements{15};  // pairs of triangles along the needle; three across
};

class ThesisNeedle {
 public:
  static constexpr int across = 4;  // nodes

  struct Force {
    double arclength_m{};
    std::array<double, 2> force_n{};
  };
  // A point of the mid-line; theta is that of the section, 0 at the clamp.
  struct Station {
    double arclength_m{};
    std::array<double, 2> position_m{};
    double theta_rad{};
  };
  // What the clamp applies to the needle; the moment about the origin, the middle of the clamp.
  struct Reaction {
    double fx_n{}, fy_n{}, tau_nm{};
  };

  enum class Status : std::uint8_t {
    Converged,
    NotConverged,  // out of iterations: the fixed point creeps or goes to and fro
    Diverged,      // the fixed point left the needle's surroundings: a step of ten lengths after the first
    Unstable,      // Newton: equilibrium, but not of least energy
    Inverted,      // Newton: a triangle would be turned inside out
  };
  struct Result {
    Status status{};
    int iterations{};     // Newton: factorisations, those of failed steps included
    double step_m{};      // largest displacement of the last iteration
    double residual_n{};  // largest entry of f - f_int(u)
    int load_steps{};     // Newton: that led to load_fraction of the load
    double load_fraction{};
  };
  struct FixedPointOptions {
    double tolerance{1e-9};  // ends when a step is at most this part of u, largest entries; print: 1e-3
    int max_iterations{10000};
  };
  struct NewtonOptions {
    double tolerance{1e-9};  // ends after a step of at most this part of the length: the next would be about its square
    int max_iterations{30};  // of each load step
    int max_halvings{10};
    bool predicted_stress{true};
  };

  // Throws Error for properties that make no needle.
  explicit ThesisNeedle(const ThesisNeedleProperties& properties);

  // Throws Error for a force that is not finite or not on the needle.
  void set_forces(std::span<const Force> forces);

  // Both start from rest and leave the last u; only Converged is an equilibrium under the whole load.
  Result fixed_point(const FixedPointOptions& options);
  Result fixed_point() { return fixed_point(FixedPointOptions{}); }
  Result newton(const NewtonOptions& options);
  Result newton() { return newton(NewtonOptions{}); }

  [[nodiscard]] const ThesisNeedleProperties& properties() const { return properties_; }
  [[nodiscard]] int stations() const { return properties_.elements + 1; }
  [[nodiscard]] Station station(int index) const;
  [[nodiscard]] Station tip() const { return station(properties_.elements); }
  [[nodiscard]] Reaction reaction() const;
  // x, y of each node by number, those of the clamp included.
  [[nodiscard]] const Eigen::VectorXd& displacement_m() const { return u_; }
  [[nodiscard]] Eigen::VectorXd internal_force_n(const Eigen::VectorXd& displacement_m) const;
  // Of the free degrees of freedom, 2 x across fewer, both triangles.
  [[nodiscard]] Eigen::MatrixXd tangent_n_per_m(const Eigen::VectorXd& displacement_m) const;
  // Of the tip across the needle at small load.
  [[nodiscard]] double small_load_compliance_m_per_n() const;

 private:
  static constexpr int clamped = 2 * across;
  static constexpr int band = 2 * (across + 1) + 2;  // entries of a column from its diagonal down
  static constexpr int window = 16;
  static_assert(band <= window - 3 && clamped % 4 == 0);
  // A column of a symmetric matrix: 16 rows from its number rounded down to a multiple of four. So all columns and vectors that elimination
  // combines are aligned alike, and what one step stores the next loads whole: with the diagonal first a Newton iteration takes twice as
  // long.
  struct alignas(64) Column {
    std::array<double, window> row;
  };
  struct Matrix {
    std::vector<Column> column;
    std::vector<double> inverse_pivot;  // factored: L below the diagonal and zeros elsewhere in the column
  };
  using Stress = std::array<double, 3>;

  struct Moduli {
    double normal{}, coupled{}, shear{};
  };
  enum class Direction : std::uint8_t { AlongThenAcross, AcrossThenAlong };
  struct Slopes;
  template <class Visit>
  void each_triangle(const Visit& visit) const;
  template <Direction direction>
  [[nodiscard]] Slopes slopes(const Eigen::VectorXd& u, int node) const;
  template <Direction direction>
  void subtract_force(const Slopes& h, const Stress& s, double* f) const;
  [[nodiscard]] Stress stress_of(double xx, double yy, double xy) const;

  void assemble(const Eigen::VectorXd& u, const Stress* stress, Matrix& k, Eigen::VectorXd& residual) const;
  void subtract_internal_force(const Eigen::VectorXd& u, Eigen::VectorXd& residual) const;
  void predict_stress();
  [[nodiscard]] bool inverted() const;
  int factor(Matrix& k) const;  // L D L^T in place; how many pivots are not positive
  template <int phase>
  static bool eliminate(Column* k, double& inverse_pivot);
  void solve(const Matrix& factored, const Eigen::VectorXd& right, Eigen::VectorXd& x) const;
  Status advance(double fraction, const NewtonOptions& options, Result& result);

  ThesisNeedleProperties properties_;
  Moduli moduli_;
  double along_m_{}, across_m_{}, volume_m3_{};  // of a triangle
  double per_along_{}, per_across_{};            // 1 / m: a division costs as much as all else of a leg
  Eigen::VectorXd load_, u_, kept_, residual_;
  Eigen::VectorXd step_;     // of solve: followed by a window of zeros
  Matrix linear_, tangent_;  // K0, factored; K
  std::vector<Stress> stress_;
};

[[nodiscard]] const char* to_string(ThesisNeedle::Status status) noexcept;

// The modulus for which the tip's compliance at small load is L^3 / (3 EI). properties.young_pa does not matter. Throws Error.
[[nodiscard]] double fitted_young_pa(const ThesisNeedleProperties& properties, double bending_nm2);

}  // namespace trocar::fem
