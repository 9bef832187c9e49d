#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace proofmass {

/// The unknowns that a normal matrix leaves open, alone or in combination with others: those with a
/// component above 0.1 in its null space. README.md derives the criterion.
///
/// @param information  Symmetric, without negative eigenvalues, finite; shape [n, n], n ≥ 1. The
///                     units of the unknowns do not matter.
/// @return Indices, ascending. Never empty: a matrix without a null space is taken to have that of
///         its smallest eigenvalue, so that a caller whose decomposition failed is told why.
[[nodiscard]] std::vector<std::size_t> undetermined_by(const Eigen::MatrixXd& information);

}  // namespace proofmass
