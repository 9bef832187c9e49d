#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator::detail {

/// Fills the tables `campaign`, `parameter`, those of the data that all runs share, and
/// `dispersion_value`.
void insert_campaign(Database& database, const Campaign& campaign, std::string_view definition);

/// Fills the tables `parameter` and `budget_coefficient`.
void insert_parameters(Database& database, const Campaign& campaign);

/// The data that all runs share; none that has no rows.
[[nodiscard]] std::vector<DataTable> read_data_tables(const Database& database);

/// Values of one drawn quantity, run by run; empty if the file has none.
[[nodiscard]] std::vector<double> read_dispersion_values(const Database& database,
                                                         std::string_view drawn_name);

/// Checks that a campaign can replace the stored one: the same but for more runs.
/// @throws StoreError naming what differs.
void check_extension(const Database& database, const Campaign& campaign);

/// Stores number of runs, definition and the table values of the new runs. @pre check_extension().
void extend_campaign(Database& database, const Campaign& campaign, std::string_view definition);

}  // namespace proofmass::coordinator::detail
