#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass::coordinator::detail {

/// Fills the tables `campaign`, `parameter`, those of the data that all runs share, and
/// `dispersion_value`.
void insert_campaign(Database& database, const Campaign& campaign, std::string_view definition);

/// Fills the tables `parameter` and `budget_coefficient`.
void insert_parameters(Database& database, const Campaign& campaign);

/// A whole number below 2⁶⁴ that is stored as text.
/// @param column  That it stands in, for messages.
/// @throws StoreError if the text is none.
[[nodiscard]] std::uint64_t number_in(const Database& database, std::string_view column,
                                      const std::string& text, int base);
[[nodiscard]] std::uint64_t read_seed(const Database& database);
/// The number of campaign.reference_digest; 0 if it is empty.
[[nodiscard]] std::uint64_t reference_digest_in(const Database& database, const std::string& text);

/// How the campaign is served: columns of `campaign`.
[[nodiscard]] CampaignControl read_control(const Database& database);
void write_control(const Database& database, const CampaignControl& control);

/// See Store::num_runs_fixed().
[[nodiscard]] std::optional<std::uint64_t> read_num_runs_fixed(const Database& database);
/// While there is no result, nobody can have looked at one: the runs that are asked for now are
/// fixed, unless a stop rule decides about their number.
void fix_num_runs(const Database& database);

/// A row of `stop_check`.
void replace_stop_check(const Database& database, std::uint64_t num_runs,
                        std::string_view statistic, const StopCheck& check);

}  // namespace proofmass::coordinator::detail
