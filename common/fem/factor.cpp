#include "common/fem/factor.hpp"

#include <cblas.h>
#include <cholmod.h>

#include <algorithm>
#include <exception>
#include <limits>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

namespace trocar::fem {
namespace {

// A pivot this small beside its diagonal entry is rounding: of the solution no digit would be right.
constexpr double least_pivot = 1e-12;

class Cholmod {
 public:
  Cholmod() { cholmod_start(&common); }
  ~Cholmod() { cholmod_finish(&common); }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
  cholmod_common common{};
};

// Blocks are solved one a core, so the BLAS itself must not divide them again: two threads that each call a BLAS of two threads take three
// times as long. Its number of threads belongs to the whole process, hence the count of those who want it to be one.
class OneBlasThread {
 public:
  OneBlasThread() {
    const std::lock_guard lock(guard);
    if (wanted++ > 0) return;
    before = openblas_get_num_threads();
    openblas_set_num_threads(1);
  }
  ~OneBlasThread() {
    const std::lock_guard lock(guard);
    if (--wanted == 0) openblas_set_num_threads(before);
  }
  OneBlasThread(const OneBlasThread&) = delete;
  OneBlasThread& operator=(const OneBlasThread&) = delete;

 private:
  inline static std::mutex guard;
  inline static int wanted = 0;
  inline static int before = 1;
};

using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  // one row an unknown, in the factor's order

}  // namespace

struct Factor::Supernodal {
  // Supernode s holds columns super[s] … super[s + 1] - 1 of L, dense and column by column, on the rows row[row_begin[s]] …, of which the
  // first are the columns themselves.
  std::vector<int> super, row_begin, row, parent, column_super;
  std::vector<std::ptrdiff_t> value_begin;
  std::vector<int> place;  // of a matrix row in L's order
  cholmod_factor* l{};
  Cholmod cholmod;
  Info info;
  Eigen::Index most_rows{};

  ~Supernodal() { cholmod_free_factor(&l, &cholmod.common); }

  [[nodiscard]] int supernodes() const { return static_cast<int>(super.size()) - 1; }
  [[nodiscard]] const double* values(int s) const { return static_cast<const double*>(l->x) + value_begin[static_cast<std::size_t>(s)]; }
  void read_structure();
  void check_pivots(const Eigen::VectorXd& diagonal) const;
  void solve(Block& x, Block& work, const std::vector<char>& reached, const std::vector<char>& needed) const;
  // Marks every ancestor of a marked supernode; children come before their parents.
  void close_upwards(std::vector<char>& marked) const {
    for (std::size_t s = 0; s < marked.size(); ++s)
      if (marked[s] != 0 && parent[s] >= 0) marked[static_cast<std::size_t>(parent[s])] = 1;
  }
};

void Factor::Supernodal::read_structure() {
  const auto count = static_cast<std::size_t>(l->nsuper);
  const auto n = static_cast<std::size_t>(l->n);
  const auto copy = [](void* from, std::size_t size) { return std::vector<int>(static_cast<int*>(from), static_cast<int*>(from) + size); };
  super = copy(l->super, count + 1);
  row_begin = copy(l->pi, count + 1);
  const std::vector<int> begin = copy(l->px, count + 1);
  value_begin.assign(begin.begin(), begin.end());
  row = copy(l->s, l->ssize);
  column_super.resize(n);
  parent.assign(count, -1);
  for (std::size_t s = 0; s < count; ++s) {
    const int columns = super[s + 1] - super[s];
    for (int c = super[s]; c < super[s + 1]; ++c) column_super[static_cast<std::size_t>(c)] = static_cast<int>(s);
    most_rows = std::max<Eigen::Index>(most_rows, row_begin[s + 1] - row_begin[s] - columns);
  }
  for (std::size_t s = 0; s < count; ++s) {
    const int first_below = row_begin[s] + super[s + 1] - super[s];
    if (first_below < row_begin[s + 1]) parent[s] = column_super[static_cast<std::size_t>(row[static_cast<std::size_t>(first_below)])];
  }
  place.resize(n);
  for (std::size_t k = 0; k < n; ++k) place[static_cast<std::size_t>(static_cast<int*>(l->Perm)[k])] = static_cast<int>(k);
  info.nonzeros = static_cast<Eigen::Index>(l->xsize);
  info.bytes = l->xsize * sizeof(double) + l->ssize * sizeof(int);
}

void Factor::Supernodal::check_pivots(const Eigen::VectorXd& diagonal) const {
  for (Eigen::Index i = 0; i < diagonal.size(); ++i) {
    const auto k = place[static_cast<std::size_t>(i)];
    const auto s = static_cast<std::size_t>(column_super[static_cast<std::size_t>(k)]);
    const auto rows = static_cast<std::ptrdiff_t>(row_begin[s + 1] - row_begin[s]);
    const double pivot = values(static_cast<int>(s))[(k - super[s]) * (rows + 1)];
    if (!(pivot * pivot > least_pivot * diagonal[i])) throw NotPositiveDefinite(i);
  }
}

// L L^T x = b in place. Supernodes that are not `reached` by b are passed over on the way down: x stays zero there. Those that no wanted
// row `needed` are passed over on the way up: x is no solution there. Row-major blocks are column-major transposes, hence the sides on
// which L stands.
void Factor::Supernodal::solve(Block& x, Block& work, const std::vector<char>& reached, const std::vector<char>& needed) const {
  const auto m = static_cast<int>(x.cols());
  const auto stride = static_cast<std::size_t>(m);
  double* const data = x.data();
  for (int s = 0; s < supernodes(); ++s) {
    const auto u = static_cast<std::size_t>(s);
    if (reached[u] == 0) continue;
    const int columns = super[u + 1] - super[u];
    const int rows = row_begin[u + 1] - row_begin[u];
    const int below = rows - columns;
    double* const own = data + static_cast<std::size_t>(super[u]) * stride;
    cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, m, columns, 1.0, values(s), rows, own, m);
    if (below == 0) continue;
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, m, below, columns, 1.0, own, m, values(s) + columns, rows, 0.0, work.data(), m);
    const int* const target = row.data() + row_begin[u] + columns;
    for (int r = 0; r < below; ++r) x.row(target[r]) -= work.row(r);
  }
  for (int s = supernodes() - 1; s >= 0; --s) {
    const auto u = static_cast<std::size_t>(s);
    if (needed[u] == 0) continue;
    const int columns = super[u + 1] - super[u];
    const int rows = row_begin[u + 1] - row_begin[u];
    const int below = rows - columns;
    double* const own = data + static_cast<std::size_t>(super[u]) * stride;
    if (below > 0) {
      const int* const source = row.data() + row_begin[u] + columns;
      for (int r = 0; r < below; ++r) work.row(r) = x.row(source[r]);
      cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, m, columns, below, -1.0, work.data(), m, values(s) + columns, rows, 1.0, own,
                  m);
    }
    cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasNoTrans, CblasNonUnit, m, columns, 1.0, values(s), rows, own, m);
  }
}

Factor::Factor(const Eigen::SparseMatrix<double>& matrix, Ordering ordering) : l_(std::make_unique<Supernodal>()) {
  cholmod_common& c = l_->cholmod.common;
  c.print = 0;
  c.supernodal = CHOLMOD_SUPERNODAL;
  c.final_ll = 1;
  c.nmethods = 1;
  c.method[0].ordering = ordering == Ordering::Amd ? CHOLMOD_AMD : ordering == Ordering::Metis ? CHOLMOD_METIS : CHOLMOD_NESDIS;
  c.postorder = 1;

  const Eigen::SparseMatrix<double> lower = matrix.triangularView<Eigen::Lower>();
  cholmod_sparse view{};
  view.nrow = view.ncol = static_cast<std::size_t>(lower.rows());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = view.packed = 1;

  const auto check = [&c] {
    if (c.status == CHOLMOD_OUT_OF_MEMORY || c.status == CHOLMOD_TOO_LARGE) throw std::bad_alloc();
    if (c.status < CHOLMOD_OK) throw std::runtime_error("CHOLMOD ended with status " + std::to_string(c.status));
  };
  l_->l = cholmod_analyze(&view, &c);
  check();
  cholmod_factorize(&view, l_->l, &c);
  check();
  if (c.status == CHOLMOD_NOT_POSDEF) throw NotPositiveDefinite(static_cast<int*>(l_->l->Perm)[l_->l->minor]);
  l_->read_structure();
  l_->info.ordering = ordering;
  l_->check_pivots(lower.diagonal());
}

Factor::~Factor() = default;

const Factor::Info& Factor::info() const { return l_->info; }

Eigen::MatrixXd Factor::solve(const Eigen::MatrixXd& right_hand_sides) const {
  constexpr Eigen::Index most = 64;
  const OneBlasThread one_thread;
  const Eigen::Index n = right_hand_sides.rows();
  const std::vector<char> all(l_->super.size() - 1, 1);
  Eigen::MatrixXd result(n, right_hand_sides.cols());
  for (Eigen::Index first = 0; first < result.cols(); first += most) {
    const Eigen::Index count = std::min(most, result.cols() - first);
    Block x(n, count);
    Block work(l_->most_rows, count);
    for (Eigen::Index i = 0; i < n; ++i) x.row(l_->place[static_cast<std::size_t>(i)]) = right_hand_sides.row(i).segment(first, count);
    l_->solve(x, work, all, all);
    for (Eigen::Index i = 0; i < n; ++i) result.row(i).segment(first, count) = x.row(l_->place[static_cast<std::size_t>(i)]);
  }
  return result;
}

void Factor::solve_columns(const Eigen::SparseMatrix<double>& right_hand_sides, Eigen::Index block, const Wanted& wanted,
                           const Sink& sink) const {
  const OneBlasThread one_thread;
  const Eigen::Index n = right_hand_sides.rows();
  const Eigen::Index blocks = (right_hand_sides.cols() + block - 1) / block;
  std::vector<char> needed(l_->super.size() - 1, 0);
  std::vector<int> place(wanted.unknown.size());
  for (std::size_t i = 0; i < place.size(); ++i) {
    place[i] = l_->place[static_cast<std::size_t>(wanted.unknown[i])];
    needed[static_cast<std::size_t>(l_->column_super[static_cast<std::size_t>(place[i])])] = 1;
  }
  l_->close_upwards(needed);
  std::mutex guard;
  Eigen::Index next = 0;
  std::exception_ptr failure;

  const auto work_on_blocks = [&] {
    try {
      Block x;
      Block work;
      Eigen::MatrixXd result;
      std::vector<char> reached(l_->super.size() - 1);
      for (;;) {
        Eigen::Index first = 0;
        {
          const std::lock_guard lock(guard);
          if (failure || next == blocks) return;
          first = block * next++;
        }
        const Eigen::Index count = std::min(block, right_hand_sides.cols() - first);
        x.setZero(n, count);
        work.resize(l_->most_rows, count);
        std::fill(reached.begin(), reached.end(), 0);
        for (Eigen::Index c = 0; c < count; ++c)
          for (Eigen::SparseMatrix<double>::InnerIterator it(right_hand_sides, first + c); it; ++it) {
            const int k = l_->place[static_cast<std::size_t>(it.row())];
            x(k, c) = it.value();
            reached[static_cast<std::size_t>(l_->column_super[static_cast<std::size_t>(k)])] = 1;
          }
        l_->close_upwards(reached);
        l_->solve(x, work, reached, needed);
        if (result.cols() != count) result.setZero(wanted.rows, count);
        for (std::size_t i = 0; i < place.size(); ++i) result.row(wanted.row[i]) = x.row(place[i]);
        const std::lock_guard lock(guard);
        if (failure) return;
        try {  // here, while nobody else can call the sink
          sink(first, result);
        } catch (...) {
          failure = std::current_exception();
        }
      }
    } catch (...) {
      const std::lock_guard lock(guard);
      if (!failure) failure = std::current_exception();
    }
  };

  const auto cores = std::min<Eigen::Index>(std::max(1u, std::thread::hardware_concurrency()), blocks);
  std::vector<std::thread> threads;
  for (Eigen::Index k = 1; k < cores; ++k) threads.emplace_back(work_on_blocks);
  work_on_blocks();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace trocar::fem
