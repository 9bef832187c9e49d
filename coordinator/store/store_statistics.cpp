// What a Store keeps of its results, and how that is held against what it should be.

#include <array>
#include <span>

#include "coordinator/store/detail/campaign_rows.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/integrity.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

using detail::ComparedTable;
using detail::Database;

namespace {

void replace_all(Database& database, const ResultSchema& schema,
                 const CampaignStatistics& statistics, const std::optional<ErrorBudget>& budget) {
  detail::replace_statistics(database, schema, statistics);
  detail::replace_budgets(database, budget, statistics);
}

// A file that was made before version 9 keeps the budget of the program that made it.
bool has_own_budget(const Database& database) {
  return database.integer("SELECT first_version > 8 FROM campaign") != 0;
}

}  // namespace

void Store::write_statistics(const CampaignStatistics& statistics,
                             const std::optional<ErrorBudget>& budget, const ResultDigests& digests,
                             std::span<const RunWarning> warnings) {
  impl_->commit([&](Database& database) {
    replace_all(database, schema(), statistics, budget);
    detail::replace_summary(database, statistics, digests);
    detail::replace_warnings(database, schema(), warnings);
  });
}

std::optional<Summary> Store::summary() const { return detail::read_summary(impl_->database); }

std::vector<std::string> Store::parameter_differences(const Campaign& campaign) const {
  constexpr std::array tables{
      ComparedTable{.name = "parameter", .row_name = "parameter"},
      ComparedTable{.name = "budget_coefficient", .row_name = "parameter || ' in ' || term"}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& expected) { detail::insert_parameters(expected, campaign); },
      std::span(tables).first(has_own_budget(impl_->database) ? 2 : 1));
}

// Intervals are of functions whose last bits depend on the processor, see
// core/statistics/distribution.hpp.
constexpr double rounding = 1e-12;

std::vector<std::string> Store::statistic_differences(const CampaignStatistics& statistics,
                                                      const std::optional<ErrorBudget>& budget,
                                                      std::span<const RunWarning> warnings) const {
  constexpr std::array tables{
      ComparedTable{.name = "statistic", .row_name = "parameter", .tolerance = rounding},
      ComparedTable{.name = "budget_entry", .row_name = "term", .tolerance = rounding},
      ComparedTable{.name = "run_warning",
                    .row_name = "effect || ' on ' || parameter || ' in run ' || run_index",
                    .tolerance = rounding}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& expected) {
        replace_all(expected, schema(), statistics, budget);
        detail::replace_warnings(expected, schema(), warnings);
      },
      std::span(tables).first(has_own_budget(impl_->database) ? 3 : 1));
}

std::vector<std::string> Store::stop_check_differences(
    std::span<const StopCheckRow> expected) const {
  constexpr std::array tables{
      ComparedTable{.name = "stop_check",
                    .row_name = "statistic || ' after ' || num_runs || ' runs'",
                    .columns = "estimate, lower, upper, relative_half_width, is_reached",
                    .tolerance = rounding}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& database) {
        for (const StopCheckRow& row : expected) {
          detail::replace_stop_check(database, row.num_runs, row.statistic, row.check);
        }
      },
      tables, detail::FurtherRows::ignore);
}

bool Store::has_statistics() const {
  return impl_->database.integer("SELECT EXISTS (SELECT 1 FROM statistic)") != 0;
}

}  // namespace proofmass::coordinator
