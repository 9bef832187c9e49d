#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// Brings the statistics of a campaign database up to its results, which are those of all runs that
/// it is to have for now, and checks its stop rule with them.
///
/// @param write  Lets its argument use the file where it is written.
/// @return The number of runs that the stop rule asks for next; empty if there is none, if it is
///         reached, or if there are as many runs as there may be.
std::optional<std::uint64_t> summarise_file(
    const std::filesystem::path& file, const Campaign& campaign,
    const std::function<void(const std::function<void(Store&)>&)>& write);

/// What `stop_check` has other than the results yield, a line each:
/// `stop_check.estimate of std(gain) after 128 runs = 1 (must be 2.5)`.
///
/// Beside the rows that are there, that of the campaign's rule and of all runs must be there once
/// the campaign has ended.
///
/// Rows of n runs are held against the results if all runs below n are finished, and were when the
/// rule was checked, as no loss was blamed on any of them.
/// @pre All results are in range, and one state of the file is read.
/// @param objectives  Those of the campaign's scenario.
[[nodiscard]] std::vector<std::string> stop_check_differences(const Store& store,
                                                              std::span<const double> objectives);

/// @throws StoreError `campaign database = x.db (is damaged: ...)` with the first of these
/// differences.
void check_stop_checks(const Store& store, std::span<const double> objectives);

/// What came of a campaign's stop rule.
struct StopOutcome {
  std::string rule = {};                   ///< As it was given.
  std::optional<StopCheckRow> check = {};  ///< That with the most runs; empty if there was none.
  std::string answer = {};  ///< `reached` or `not reached`, or that of a requirement; or empty.
  /// Lines of at most 80 characters unless the rule is longer; empty if it was not checked.
  std::string text = {};
  bool is_missed = false;  ///< See is_rule_missed().
};

/// Empty without a rule.
[[nodiscard]] std::optional<StopOutcome> stop_outcome(const Store& store);

/// True if a campaign has a stop rule that was not checked with as many runs as the campaign is to
/// have for now.
[[nodiscard]] bool lacks_stop_check(const Store& store);

/// True if a campaign has a stop rule that was not checked, see lacks_stop_check(), or not reached,
/// or one that ends in `decided` whose requirement is not met.
[[nodiscard]] bool is_rule_missed(const Store& store);

}  // namespace proofmass::coordinator
