// A sparse symmetric positive definite matrix, factored: A = P^T L L^T P, supernodal. CHOLMOD (its supernodal module is under the GPL) and
// the BLAS are known to factor.cpp alone.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace trocar::fem {

// Fill-reducing orderings. Measured in tests/benchmarks/fem_benchmark.cpp; Metis is the default because it wins there in 3-D, where it
// matters.
enum class Ordering : std::uint8_t { Amd, Metis, NestedDissection };

// The matrix is not positive definite, or so nearly singular that its solutions would be noise: the pivot of `row` vanishes.
class NotPositiveDefinite : public std::runtime_error {
 public:
  explicit NotPositiveDefinite(Eigen::Index at) : std::runtime_error("matrix is not positive definite"), row(at) {}
  Eigen::Index row;
};

class Factor {
 public:
  struct Info {
    Eigen::Index nonzeros{};  // of L, as stored
    std::size_t bytes{};
    Ordering ordering{};
  };

  // Reads the lower triangle. Throws NotPositiveDefinite; std::bad_alloc when memory does not suffice.
  explicit Factor(const Eigen::SparseMatrix<double>& matrix, Ordering ordering = Ordering::Metis);
  ~Factor();
  Factor(const Factor&) = delete;
  Factor& operator=(const Factor&) = delete;

  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides) const;

  // sink(first, x) with x = A^-1 times columns first … of `right_hand_sides`, `block` columns at a time (the last may be fewer).
  // Blocks are solved on all cores; the sink is called by one thread at a time, in any order of the blocks. What it throws ends the
  // call and is thrown again. The values do not depend on which core solved a block.
  using Sink = std::function<void(Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& x)>;
  void solve_columns(const Eigen::SparseMatrix<double>& right_hand_sides, Eigen::Index block, const Sink& sink) const;

  [[nodiscard]] const Info& info() const;

 private:
  struct Supernodal;
  std::unique_ptr<Supernodal> l_;
};

}  // namespace trocar::fem
