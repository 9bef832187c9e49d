#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/campaign/run_result.hpp"

namespace proofmass {

/// Square matrix of any size, row by row.
class SquareMatrix {
 public:
  explicit SquareMatrix(std::size_t size) : size_(size), elements_(size * size) {}

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] double& operator()(std::size_t i, std::size_t j) {
    return elements_[i * size_ + j];
  }
  [[nodiscard]] double operator()(std::size_t i, std::size_t j) const {
    return elements_[i * size_ + j];
  }

 private:
  std::size_t size_;
  std::vector<double> elements_;
};

/// The inverse of the matrix of normal equations: the covariance of what they estimate.
///
/// Each sum has a fixed order, so that the bits are the same on every processor. The unknowns are
/// scaled to a diagonal of ones first, as their units may be anything.
///
/// @param matrix  Symmetric.
/// @return Nothing if the matrix is not positive definite to within rounding: some combination of
///         the unknowns is not observed.
[[nodiscard]] std::optional<SquareMatrix> covariance(const SquareMatrix& matrix);

/// matrix · vector.
[[nodiscard]] std::vector<double> product(const SquareMatrix& matrix,
                                          const std::vector<double>& vector);

/// Standard errors and correlations of a result whose quantities all have one.
void set_uncertainty(RunResult& result, const SquareMatrix& covariance);

}  // namespace proofmass
