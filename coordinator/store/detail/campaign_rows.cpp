#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::int64_t campaign_uid_max = std::numeric_limits<std::int64_t>::max();

// The schema allows no other names, but a file from elsewhere may have another one.
wire::CampaignPhase read_phase(const Database& database, std::string_view name) {
  using enum wire::CampaignPhase;
  for (const wire::CampaignPhase phase : {active, paused, finished, cancelled}) {
    if (wire::name_of(phase) == name) return phase;
  }
  database.refuse_as_damaged(fmt::format("phase = {}", name));
}

void insert_data_tables(Database& database, const Campaign& campaign) {
  const std::vector<DataTable> tables = campaign.definition(TableColumns::left_out).tables;
  for (const DataTableSchema& schema : campaign.model().tables()) {
    const auto table = std::ranges::find(tables, schema.key, &DataTable::key);
    if (table == tables.end()) continue;
    const int num_columns = static_cast<int>(schema.columns.size());
    PROOFMASS_EXPECT(static_cast<int>(table->num_columns) == num_columns);
    Statement insert = database.prepare(
        fmt::format("INSERT INTO {} VALUES ({})", schema.table, places(num_columns + 1)));
    auto value = table->values.begin();
    for (std::uint64_t position = 1; value != table->values.end(); ++position) {
      insert.put(position);
      for (int column = 0; column < num_columns; ++column) insert.put(*value++);
      insert.finish();
    }
  }
}

// Only runs of the campaign are stored: files may well hold values for more.
void insert_dispersion_values(Database& database, const Campaign& campaign,
                              std::uint64_t first_run) {
  Statement insert = database.prepare("INSERT INTO dispersion_value VALUES (?, ?, ?)");
  const std::vector<std::size_t> quantities = campaign.table_quantities();
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const std::vector<double>& values = campaign.table_columns[i];
    const std::string_view name = campaign.model().drawn()[quantities[i]].name;
    for (std::uint64_t run = first_run; run < campaign.num_runs; ++run) {
      insert.run(name, run, values[run]);
    }
  }
}

/// While there is no result, nobody can have looked at one: the runs that are asked for now are
/// fixed, unless a stop rule decides about their number.
void fix_num_runs(const Database& database) {
  database
      .prepare(
          "UPDATE campaign SET num_runs_fixed = iif(stop_rule = '', num_runs, NULL)"
          " WHERE NOT EXISTS (SELECT 1 FROM delivery)")
      .run();
}

void insert_budget_coefficients(Database& database, const Campaign& campaign) {
  const std::optional<ErrorBudget> budget = campaign.error_budget();
  if (!budget) return;
  Statement insert = database.prepare("INSERT INTO budget_coefficient VALUES (?, ?, ?, ?)");
  const std::vector<Quantity> quantities = campaign.results().quantities;
  for (const BudgetTerm& term : budget->terms) {
    std::optional<double> level;
    if (term.follows_level) level = budget->assumed_level;
    for (std::size_t j = 0; j < quantities.size(); ++j) {
      const double value = term.coefficients[j];
      if (value != 0.0) insert.run(term.info.name, quantities[j].name, value, level);
    }
  }
}

}  // namespace

void insert_parameters(Database& database, const Campaign& campaign) {
  Statement insert = database.prepare("INSERT INTO parameter VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  const std::vector<double> objectives = campaign.objectives();
  std::uint64_t position = 0;
  for (const Quantity& quantity : campaign.results().quantities) {
    const double objective = objectives[position++];
    const auto published = [&](double PublishedAccuracy::*figure) {
      return quantity.published ? std::optional((*quantity.published).*figure) : std::nullopt;
    };
    insert.run(position, quantity.name, quantity.symbol, quantity.unit,
               std::isfinite(objective) ? std::optional(objective) : std::nullopt,
               published(&PublishedAccuracy::worst), published(&PublishedAccuracy::mean),
               published(&PublishedAccuracy::standard_deviation));
  }
  insert_budget_coefficients(database, campaign);
}

void insert_campaign(Database& database, const Campaign& campaign, std::string_view definition) {
  // Models in C++ are tested to compute the same everywhere, and imports have no reference runs.
  const Model& model = campaign.model();
  const std::uint64_t digest =
      model.description().empty() ? 0 : model.reference_digest(best_instruction_set());
  const std::string reference_digest = digest == 0 ? "" : fmt::format("{:016x}", digest);
  database
      .prepare(
          "INSERT INTO campaign (campaign_id, name, seed, num_runs, definition, model_version,"
          " model_description, reference_digest, build, campaign_uid, first_version, created_utc)"
          " VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, 1 + (random() & ?), 9,"
          " strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))")
      .run(campaign.name, std::to_string(campaign.seed), campaign.num_runs, definition,
           model.version(), std::string(model.description()), reference_digest,
           std::string_view(PROOFMASS_BUILD), campaign_uid_max - 1);
  insert_parameters(database, campaign);
  insert_data_tables(database, campaign);
  insert_dispersion_values(database, campaign, 0);
  fix_num_runs(database);
  write_table_digest(database, campaign.model());
}

std::uint64_t number_in(const Database& database, std::string_view column, const std::string& text,
                        int base) {
  std::uint64_t number = 0;
  const char* const text_end = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), text_end, number, base);
  if (error == std::errc() && end == text_end) return number;
  database.refuse_as_damaged(fmt::format("{} = {}", column, text));
}

std::uint64_t read_seed(const Database& database) {
  return number_in(database, "seed", database.text("SELECT seed FROM campaign"), 10);
}

std::uint64_t reference_digest_in(const Database& database, const std::string& text) {
  return text.empty() ? 0 : number_in(database, "reference_digest", text, 16);
}

CampaignControl read_control(const Database& database) {
  const Statement select =
      database.first_row("SELECT phase, priority, audit_fraction FROM campaign");
  const std::int64_t priority = select.integer(1);
  const double audit_fraction = select.real(2);
  if (priority < std::numeric_limits<int>::min() || priority > std::numeric_limits<int>::max()) {
    database.refuse_as_damaged(fmt::format("priority = {}", priority));
  }
  if (!(audit_fraction >= 0.0 && audit_fraction <= 1.0)) {
    database.refuse_as_damaged(fmt::format("audit_fraction = {}", audit_fraction));
  }
  return {.phase = read_phase(database, select.text(0)),
          .priority = static_cast<int>(priority),
          .audit_fraction = audit_fraction};
}

void write_control(const Database& database, const CampaignControl& control) {
  database.prepare("UPDATE campaign SET phase = ?, priority = ?, audit_fraction = ?")
      .run(wire::name_of(control.phase), std::int64_t{control.priority}, control.audit_fraction);
}

}  // namespace proofmass::coordinator::detail

namespace proofmass::coordinator {

std::shared_ptr<const Campaign> Store::campaign() const {
  const detail::Statement row =
      impl_->database.first_row("SELECT definition, name, seed, num_runs FROM campaign");
  return wire::recorded_campaign(model(),
                                 {.definition = row.text(0),
                                  .name = row.text(1),
                                  .seed = row.text(2),
                                  .num_runs = row.text(3)},
                                 "main", [this](const std::string& sql) {
                                   std::vector<double> numbers;
                                   detail::Statement of = impl_->database.prepare(sql);
                                   while (of.step()) {
                                     for (int i = 0; i < of.num_columns(); ++i) {
                                       numbers.push_back(of.real(i));
                                     }
                                   }
                                   return numbers;
                                 });
}

std::optional<std::uint64_t> Store::num_runs_fixed() const {
  return impl_->database.first_row("SELECT num_runs_fixed FROM campaign").optional_count(0);
}

StopPlan Store::stop_plan() const {
  const detail::Statement select =
      impl_->database.first_row("SELECT stop_rule, num_runs_max, failures_max FROM campaign");
  return {.stop_rule = select.text(0),
          .num_runs_max = select.optional_count(1),
          .failures_max = select.optional_count(2)};
}

void Store::set_stop_plan(const StopPlan& plan) {
  impl_->commit([&](detail::Database& database) {
    database
        .prepare(
            "UPDATE campaign SET stop_rule = ?1, num_runs_max = ?2, failures_max = ?3,"
            " phase = iif(phase = 'finished' AND ?1 <> ''"
            " AND (stop_rule, num_runs_max, failures_max) IS NOT (?1, ?2, ?3), 'active', phase)")
        .run(plan.stop_rule, plan.num_runs_max, plan.failures_max);
    detail::fix_num_runs(database);
    detail::write_table_digest(database, model());
  });
}

void Store::extend(const Campaign& campaign, std::string_view definition) {
  impl_->commit([&](detail::Database& database) {
    const std::uint64_t num_before = num_runs();
    if (campaign.num_runs < num_before) {
      database.refuse(
          fmt::format("has {} runs, and was to have {}", num_before, campaign.num_runs));
    }
    detail::insert_dispersion_values(database, campaign, num_before);
    database.prepare("UPDATE campaign SET num_runs = ?, definition = ?")
        .run(campaign.num_runs, definition);
    detail::fix_num_runs(database);
    detail::write_table_digest(database, campaign.model());
  });
}

}  // namespace proofmass::coordinator
