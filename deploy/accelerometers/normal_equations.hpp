#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/campaign/run_result.hpp"

namespace proofmass {

/// The inverse of the matrix of normal equations: the covariance of what they estimate.
///
/// The bits are the same on every processor. The unknowns are scaled to a diagonal of ones first,
/// as their units may be anything.
///
/// @param matrix  Symmetric.
/// @return Nothing if the matrix is not positive definite to within rounding: some combination of
///         the unknowns is not observed.
[[nodiscard]] std::optional<Eigen::MatrixXd> covariance(const Eigen::MatrixXd& matrix);

/// Standard errors and correlations of a result whose quantities all have one.
void set_uncertainty(RunResult& result, const Eigen::MatrixXd& covariance);

}  // namespace proofmass
