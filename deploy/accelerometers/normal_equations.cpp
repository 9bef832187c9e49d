#include "normal_equations.hpp"

#include <cmath>

namespace proofmass {
namespace {

/// L with L Lᵀ = matrix; nothing if a pivot is lost in the rounding of a diagonal of ones.
std::optional<SquareMatrix> cholesky(const SquareMatrix& matrix) {
  SquareMatrix lower(matrix.size());
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double rest = matrix(i, j);
      for (std::size_t k = 0; k < j; ++k) rest -= lower(i, k) * lower(j, k);
      if (i != j) {
        lower(i, j) = rest / lower(j, j);
      } else if (rest > 1e-14) {
        lower(i, i) = std::sqrt(rest);
      } else {
        return std::nullopt;
      }
    }
  }
  return lower;
}

SquareMatrix inverse_of_lower(const SquareMatrix& lower) {
  SquareMatrix inverse(lower.size());
  for (std::size_t j = 0; j < lower.size(); ++j) {
    inverse(j, j) = 1.0 / lower(j, j);
    for (std::size_t i = j + 1; i < lower.size(); ++i) {
      double sum = 0.0;
      for (std::size_t k = j; k < i; ++k) sum += lower(i, k) * inverse(k, j);
      inverse(i, j) = -sum / lower(i, i);
    }
  }
  return inverse;
}

}  // namespace

std::optional<SquareMatrix> covariance(const SquareMatrix& matrix) {
  const std::size_t size = matrix.size();
  std::vector<double> scale(size);
  for (std::size_t i = 0; i < size; ++i) {
    if (!(matrix(i, i) > 0.0)) return std::nullopt;
    scale[i] = 1.0 / std::sqrt(matrix(i, i));
  }
  SquareMatrix scaled(size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) scaled(i, j) = matrix(i, j) * scale[i] * scale[j];
  }
  const std::optional<SquareMatrix> lower = cholesky(scaled);
  if (!lower) return std::nullopt;
  const SquareMatrix inverse = inverse_of_lower(*lower);
  SquareMatrix result(size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (std::size_t k = i; k < size; ++k) sum += inverse(k, i) * inverse(k, j);
      result(i, j) = result(j, i) = sum * scale[i] * scale[j];
    }
  }
  return result;
}

std::vector<double> product(const SquareMatrix& matrix, const std::vector<double>& vector) {
  std::vector<double> result(matrix.size());
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    for (std::size_t j = 0; j < matrix.size(); ++j) result[i] += matrix(i, j) * vector[j];
  }
  return result;
}

void set_uncertainty(RunResult& result, const SquareMatrix& covariance) {
  const std::size_t size = covariance.size();
  for (std::size_t i = 0; i < size; ++i) {
    result.standard_error.push_back(std::sqrt(covariance(i, i)));
  }
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = i + 1; j < size; ++j) {
      const double product = result.standard_error[i] * result.standard_error[j];
      result.correlations.push_back(product > 0.0 ? covariance(i, j) / product : 0.0);
    }
  }
}

}  // namespace proofmass
