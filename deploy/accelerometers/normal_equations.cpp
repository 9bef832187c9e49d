#include "normal_equations.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace proofmass {

std::optional<Eigen::MatrixXd> covariance(const Eigen::MatrixXd& matrix) {
  if (!(matrix.diagonal().array() > 0.0).all()) return std::nullopt;
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factors(scale.asDiagonal() * matrix * scale.asDiagonal());
  constexpr double rounding = 1e-14;  // What is left of a diagonal of ones.
  if (!(factors.vectorD().array() > rounding).all()) return std::nullopt;
  // A column at a time: in products of large matrices the order of sums follows from caches.
  Eigen::MatrixXd inverse(matrix.rows(), matrix.cols());
  for (Eigen::Index i = 0; i < matrix.cols(); ++i) {
    inverse.col(i) = factors.solve(Eigen::VectorXd::Unit(matrix.rows(), i));
  }
  return scale.asDiagonal() * (0.5 * (inverse + inverse.transpose())) * scale.asDiagonal();
}

void set_uncertainty(RunResult& result, const Eigen::MatrixXd& covariance) {
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    result.standard_error.push_back(std::sqrt(covariance(i, i)));
  }
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    for (Eigen::Index j = i + 1; j < covariance.rows(); ++j) {
      const double product = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      result.correlations.push_back(product > 0.0 ? covariance(i, j) / product : 0.0);
    }
  }
}

}  // namespace proofmass
