#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/report/digest.hpp"
#include "coordinator/report/run_totals.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

/// Everything that `proofmass report` prints: summary and all tables, computed from the results in
/// the file. Lines have at most 80 characters.
/// @throws StoreError if results, given-up runs or stop checks are not what was stored; see
///         check_digest().
[[nodiscard]] std::string report_text(const Store& store, const Campaign& campaign);

/// Name, seed, and how many runs ended how.
/// @param num_runs  Runs wanted.
/// @param digest    Of the results; see Digest.
/// @param check     A line says so if the digest could not be checked.
[[nodiscard]] std::string summary_text(std::string_view name, std::uint64_t seed,
                                       std::uint64_t num_runs, const CampaignStatistics& statistics,
                                       std::string_view digest,
                                       DigestCheck check = DigestCheck::holds);

/// The line that names the runs that were given up; empty if there are none.
/// @param given_up  Ascending.
[[nodiscard]] std::string given_up_text(std::span<const RunRange> given_up);

/// Accuracy of each parameter beside [Hardy2013] tab:perfo-numerical.
[[nodiscard]] std::string accuracy_table(const Campaign& campaign,
                                         const CampaignStatistics& statistics);

/// What the draws that were made say about all draws: 95 % intervals of mean and standard
/// deviation, and the errors' bias and skewness.
/// @param num_given_up  Runs that have no result, beside those in the statistics.
[[nodiscard]] std::string interval_table(const CampaignStatistics& statistics,
                                         std::uint64_t num_given_up);

/// Of the error with its sign the interval of its bias; percentiles of |error|; how often a
/// parameter is beyond its objective; and how often all objectives hold together.
/// @param num_given_up  Runs that have no result, beside those in the statistics.
[[nodiscard]] std::string error_table(const CampaignStatistics& statistics,
                                      std::uint64_t num_given_up);

/// Budget before and after calibration beside [Hardy2013] tab:Budget and tab:Budget_cali, and what
/// single runs have.
[[nodiscard]] std::string budget_table(const Campaign& campaign,
                                       const CampaignStatistics& statistics,
                                       const std::optional<RunTotals>& totals);

/// What the results of a campaign database yield.
struct ReadResults {
  CampaignStatistics statistics;
  ResultDigests digests;
  std::optional<RunTotals> totals;  ///< Empty if no run has an estimate.
};

/// Reads all results, of one state of the file, as often as StatisticsPasses needs them: twice if
/// they are many. Memory does not grow with them.
/// @throws Error if a number is out of range, see require_in_range().
[[nodiscard]] ReadResults read_results(const Store& store, const Campaign& campaign);

/// What a report is made of.
struct CheckedResults {
  ReadResults results;
  DigestCheck check = DigestCheck::holds;
  std::vector<RunRange> given_up;  ///< Ascending.
};

/// Reads all results, of one state of the file, and holds them against what is stored beside them.
/// @throws StoreError as report_text() does.
[[nodiscard]] CheckedResults read_checked_results(const Store& store, const Campaign& campaign);

/// Stores statistics, their digest, and the budgets that follow from them in the file.
void write_statistics(Store& store, const Campaign& campaign, const ReadResults& results);

/// What `statistic` and `budget_entry` have other than write_statistics() would store, a line each:
/// `statistic.mean of k2d = 1 (must be 25.5)`.
[[nodiscard]] std::vector<std::string> statistic_differences(const Store& store,
                                                             const Campaign& campaign,
                                                             const CampaignStatistics& statistics);

/// Brings the statistics and budgets that are stored in the file up to its results; does nothing
/// if they are.
void update_statistics(Store& store, const Campaign& campaign);

}  // namespace proofmass::coordinator
