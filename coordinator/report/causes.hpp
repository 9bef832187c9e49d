#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// A part of the sum that explains the error of a quantity, see explanatory_terms().
struct CauseTerm {
  std::size_t quantity = 0;
  std::string name;      ///< A drawn quantity, a true parameter, or a product: `true a × true b`.
  double slope = 0.0;    ///< SI.
  double share = 0.0;    ///< Of the error's variance, beyond the terms before it.
  double p_value = 1.0;  ///< That chance alone explains as much.
};

/// How the errors of a campaign follow from what its runs drew.
struct Causes {
  std::uint64_t num_runs = 0;           ///< That were used: the first ones with an estimate.
  std::uint64_t num_with_estimate = 0;  ///< In the database.
  std::vector<CauseTerm> terms;         ///< By quantity, the largest share first.
  /// The terms and what else correlates the most with an error, each once.
  std::vector<std::string> inputs;
  /// Linear correlation with the error, sign included, shape [inputs][quantities]. Empty where one
  /// of both does not vary, and below 4/√n, which chance alone exceeds in one case of 15,000.
  std::vector<std::vector<std::optional<double>>> correlations;
};

/// Runs that causes are computed from at most. Shares and slopes are known to a percent from these,
/// and the search takes seconds.
inline constexpr std::uint64_t cause_runs_max = 20'000;

/// @return Nothing below 16 runs with an estimate.
/// @throws StoreError as read_drawn_runs() does.
[[nodiscard]] std::optional<Causes> find_causes(const Store& store, const Campaign& campaign);

}  // namespace proofmass::coordinator
