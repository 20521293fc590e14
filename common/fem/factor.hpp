// A sparse symmetric positive definite matrix, factored: A = P^T L L^T P, supernodal. CHOLMOD (its supernodal module is under the GPL) and
// the BLAS are known to factor.cpp alone.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

namespace trocar::fem {

// Fill-reducing orderings. Entries of L and seconds, by tests/benchmarks/fem_benchmark.cpp on two cores, one of them busy:
//   20,000 unknowns in the plane   Amd 1.64 million, 0.14   Metis 1.62 million, 0.12   NestedDissection 1.61 million, 0.11
//   100,000 unknowns of bricks     Amd 118 million, 14.5    Metis 67 million, 6.1      NestedDissection 66 million, 6.4
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

  // The rows of a block of solutions that are wanted: row[i] of its `rows` rows is the solution's unknown[i], the others are zero.
  struct Wanted {
    Eigen::Index rows{};
    std::vector<int> row{};
    std::vector<int> unknown{};
  };
  // sink(first, x) with the wanted rows of A^-1 times columns first … of `right_hand_sides`, `block` columns at a time (the last may be
  // fewer). Only the part of L that the block's entries reach is solved downwards, only what leads to wanted rows upwards: columns that
  // are close together in the mesh belong into one block. Blocks are solved on all cores, each by one, so the bits do not depend on their
  // number; the sink is called by one thread at a time, in any order of the blocks. What it throws ends the call and is thrown again.
  // Memory beyond the factor: on each core (unknowns + rows + widest supernode) x block numbers.
  using Sink = std::function<void(Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& x)>;
  void solve_columns(const Eigen::SparseMatrix<double>& right_hand_sides, Eigen::Index block, const Wanted& wanted, const Sink& sink) const;

  [[nodiscard]] const Info& info() const;

 private:
  struct Supernodal;
  std::unique_ptr<Supernodal> l_;
};

}  // namespace trocar::fem
