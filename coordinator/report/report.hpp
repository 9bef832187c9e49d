#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/statistics.hpp"
#include "core/runs.hpp"

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

/// Accuracy of each parameter beside the published one, and whose that is.
[[nodiscard]] std::string accuracy_table(const Campaign& campaign,
                                         const CampaignStatistics& statistics);

/// What the draws that were made say about all draws: 95 % intervals of mean and standard
/// deviation, and the errors' bias and skewness.
/// @param num_given_up  Runs that have no result, beside those in the statistics.
[[nodiscard]] std::string interval_table(const CampaignStatistics& statistics,
                                         std::uint64_t num_given_up);

/// Which biases differ from 0 if all parameters are looked at together: a table of ten intervals
/// invites to look for one without 0, which chance alone makes in 40 % of all campaigns.
[[nodiscard]] std::string bias_sentence(const CampaignStatistics& statistics);

/// Of the error with its sign the interval of its bias; percentiles of |error|; how often a
/// parameter is beyond its objective; and how often all objectives hold together.
/// @param num_given_up  Runs that have no result, beside those in the statistics.
[[nodiscard]] std::string error_table(const CampaignStatistics& statistics,
                                      std::uint64_t num_given_up);

/// What the level of a budget is, and that it is the one of the runs or an assumed one.
/// @param figure  Spells a number.
[[nodiscard]] std::string level_text(const ErrorBudget& budget,
                                     const CampaignStatistics& statistics,
                                     std::string (*figure)(double));

/// Budget before and after estimation beside the published one, and what single runs have.
[[nodiscard]] std::string budget_table(const Campaign& campaign,
                                       const CampaignStatistics& statistics,
                                       const std::optional<RunTotals>& totals);

}  // namespace proofmass::coordinator
