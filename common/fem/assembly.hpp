// Sparse matrices over a mesh: the pattern once, element matrices added into it as often as needed, supported degrees of freedom left out.
#pragma once

#include <Eigen/SparseCore>
#include <string>
#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

class Assembly {
 public:
  // The pattern, all zero; the mesh must outlive it. Throws Error for a mesh without elements or too large for one matrix.
  explicit Assembly(const Mesh& mesh);

  void clear();
  void add(std::size_t element, const element::Stiffness& k_e);
  [[nodiscard]] const Eigen::SparseMatrix<double>& matrix() const { return matrix_; }  // both triangles, dimension() rows a node

 private:
  const Mesh* mesh_;
  // Nodes that share an element with node n, itself among them: neighbour_[begin_[n]] … increasing.
  std::vector<std::size_t> begin_{};
  std::vector<int> neighbour_{};
  Eigen::SparseMatrix<double> matrix_{};
};

// The free degrees of freedom, numbered in their order.
struct Equations {
  explicit Equations(const std::vector<bool>& supported);

  [[nodiscard]] Eigen::Index count() const { return static_cast<Eigen::Index>(unknown.size()); }
  [[nodiscard]] bool supported(Eigen::Index degree_of_freedom) const { return row[static_cast<std::size_t>(degree_of_freedom)] < 0; }
  // The lower triangle of `matrix` between free degrees of freedom.
  [[nodiscard]] Eigen::SparseMatrix<double> reduce(const Eigen::SparseMatrix<double>& matrix) const;

  std::vector<int> row{};      // of each degree of freedom, -1 where supported
  std::vector<int> unknown{};  // degree of freedom of each row
};

// What an Error says of an element without positive volume.
[[nodiscard]] std::string inverted_element(const Mesh& mesh, std::size_t element);

// "node 7 at (0.01, 0, 0.02) m"
[[nodiscard]] std::string node_in_words(const Mesh& mesh, Eigen::Index degree_of_freedom);

}  // namespace trocar::fem
