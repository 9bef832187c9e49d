#include "core/microscope/planning/undetermined.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace proofmass {

std::vector<std::size_t> undetermined_by(const Eigen::MatrixXd& information) {
  // Each unknown in units of what it would be known to if all others were known.
  const Eigen::VectorXd unit = information.diagonal().unaryExpr(
      [](double diagonal) { return diagonal > 0.0 ? 1.0 / std::sqrt(diagonal) : 1.0; });
  const Eigen::MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);  // Of rising eigenvalue.
  constexpr double eigenvalue_max = 1e-12;
  constexpr double component_min = 0.1;
  Eigen::VectorXd squares = solver.eigenvectors().col(0).cwiseAbs2();
  for (Eigen::Index i = 1; i < scaled.rows() && solver.eigenvalues()[i] <= eigenvalue_max; ++i) {
    squares += solver.eigenvectors().col(i).cwiseAbs2();
  }
  std::vector<std::size_t> unknowns;
  for (Eigen::Index i = 0; i < scaled.rows(); ++i) {
    if (squares[i] <= component_min * component_min) continue;
    unknowns.push_back(static_cast<std::size_t>(i));
  }
  return unknowns;
}

}  // namespace proofmass
