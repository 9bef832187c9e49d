// What a Store keeps of its results, and how that is held against what it should be.

#include <array>
#include <span>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/rows.hpp"
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

std::optional<Summary> Store::summary() const {
  detail::Statement select = impl_->database.prepare(
      "SELECT num_finished, num_estimated, num_not_converged, num_not_finite, num_no_draw,"
      " num_given_up, digest, computed_utc, num_lost, health_digest, num_within_objectives,"
      " within_objectives_lower, within_objectives_upper FROM summary");
  if (!select.step()) return std::nullopt;
  return Summary{.num_finished = select.count(0),
                 .num_estimated = select.count(1),
                 .num_not_converged = select.count(2),
                 .num_not_finite = select.count(3),
                 .num_no_draw = select.count(4),
                 .num_lost = select.count(8),
                 .num_given_up = select.count(5),
                 .num_within_objectives = select.count(10),
                 .within_objectives = select.interval(11),
                 .digests = {.results = select.text(6), .health = select.text(9)},
                 .computed_utc = select.text(7)};
}

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
