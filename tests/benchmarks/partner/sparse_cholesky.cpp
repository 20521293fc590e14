#include "tests/benchmarks/partner/sparse_cholesky.hpp"

#include <cholmod.h>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace trocar::partner {

struct SparseCholesky::State {
  cholmod_common common{};
  Eigen::SparseMatrix<double> lower{};
  cholmod_sparse view{};
  cholmod_factor* l{};
  cholmod_dense* x{};
  cholmod_dense* y{};
  cholmod_dense* e{};

  State() { cholmod_start(&common); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    cholmod_free_dense(&x, &common);
    cholmod_free_dense(&y, &common);
    cholmod_free_dense(&e, &common);
    cholmod_free_factor(&l, &common);
    cholmod_finish(&common);
  }
  void check(const char* step) const {
    if (common.status != CHOLMOD_OK)
      throw std::runtime_error(std::string("sparse Cholesky: ") + step + " ended with CHOLMOD status " + std::to_string(common.status));
  }
};

SparseCholesky::SparseCholesky(const Eigen::SparseMatrix<double>& matrix) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.common.print = 0;
  s.common.supernodal = CHOLMOD_SUPERNODAL;
  s.common.nmethods = 2;
  s.common.method[0].ordering = CHOLMOD_AMD;
  s.common.method[1].ordering = CHOLMOD_METIS;
  s.lower = matrix.triangularView<Eigen::Lower>();
  s.lower.makeCompressed();
  s.view.nrow = s.view.ncol = static_cast<std::size_t>(s.lower.rows());
  s.view.nzmax = static_cast<std::size_t>(s.lower.nonZeros());
  s.view.p = s.lower.outerIndexPtr();
  s.view.i = s.lower.innerIndexPtr();
  s.view.x = s.lower.valuePtr();
  s.view.stype = -1;
  s.view.itype = CHOLMOD_INT;
  s.view.xtype = CHOLMOD_REAL;
  s.view.dtype = CHOLMOD_DOUBLE;
  s.view.sorted = s.view.packed = 1;
  s.l = cholmod_analyze(&s.view, &s.common);
  s.check("the analysis");
}

SparseCholesky::~SparseCholesky() = default;

Eigen::Index SparseCholesky::rows() const { return state_->lower.rows(); }
double* SparseCholesky::values() { return state_->lower.valuePtr(); }
double SparseCholesky::factor_nonzeros() const { return state_->common.lnz; }

int SparseCholesky::slot(int row, int column) const {
  if (row < column) std::swap(row, column);
  const int* const begin = state_->lower.innerIndexPtr() + state_->lower.outerIndexPtr()[column];
  const int* const end = state_->lower.innerIndexPtr() + state_->lower.outerIndexPtr()[column + 1];
  const int* const found = std::lower_bound(begin, end, row);
  if (found == end || *found != row) throw std::runtime_error("sparse Cholesky: the pattern lacks an entry");
  return static_cast<int>(found - state_->lower.innerIndexPtr());
}

void SparseCholesky::factor() {
  cholmod_factorize(&state_->view, state_->l, &state_->common);
  state_->check("the factorisation");
}

Eigen::Map<const Eigen::MatrixXd> SparseCholesky::solve(const Eigen::Ref<const Eigen::MatrixXd>& right_hand_sides) {
  State& s = *state_;
  cholmod_dense b{};
  b.nrow = static_cast<std::size_t>(right_hand_sides.rows());
  b.ncol = static_cast<std::size_t>(right_hand_sides.cols());
  b.d = static_cast<std::size_t>(right_hand_sides.outerStride());
  b.nzmax = b.d * b.ncol;
  b.x = const_cast<double*>(right_hand_sides.data());
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  cholmod_solve2(CHOLMOD_A, s.l, &b, nullptr, &s.x, nullptr, &s.y, &s.e, &s.common);
  s.check("a solve");
  return {static_cast<const double*>(s.x->x), right_hand_sides.rows(), right_hand_sides.cols()};
}

}  // namespace trocar::partner
