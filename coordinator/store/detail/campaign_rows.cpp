#include "coordinator/store/detail/campaign_rows.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <limits>
#include <string>

#include "coordinator/store/detail/table_digest.hpp"
#include "coordinator/store/store_error.hpp"
#include "core/campaign/budget.hpp"
#include "core/campaign/parameter.hpp"
#include "core/simulation/run.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::int64_t campaign_uid_max = std::numeric_limits<std::int64_t>::max();

std::uint64_t stored_num_runs(const Database& database) {
  return database.count("SELECT num_runs FROM campaign");
}

void insert_environment(Database& database, const EnvironmentTable& table) {
  Statement insert =
      database.prepare("INSERT INTO environment_row VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  std::uint64_t position = 0;
  for (const EnvironmentRow& row : table) {
    insert.run(++position, row.time_s, row.linear_m_s2[0], row.linear_m_s2[1], row.linear_m_s2[2],
               row.angular_rad_s2[0], row.angular_rad_s2[1], row.angular_rad_s2[2]);
  }
}

// Only runs of the campaign are stored: files may well hold values for more.
void insert_dispersion_values(Database& database, const Campaign& campaign,
                              std::uint64_t first_run) {
  Statement insert = database.prepare("INSERT INTO dispersion_value VALUES (?, ?, ?)");
  const std::vector<std::size_t> elements = table_elements(campaign.dispersions);
  if (elements.size() != campaign.table_columns.size()) {
    throw StoreError(fmt::format("dispersion tables = {} (must be {}, one for each such quantity)",
                                 campaign.table_columns.size(), elements.size()));
  }
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::vector<double>& values = campaign.table_columns[i];
    if (values.size() < campaign.num_runs) {
      throw StoreError(
          fmt::format("dispersion.{} = table of {} values (must be {}, one for each run)",
                      drawn_names()[elements[i]], values.size(), campaign.num_runs));
    }
    for (std::uint64_t run = first_run; run < campaign.num_runs; ++run) {
      insert.run(drawn_names()[elements[i]], run, values[run]);
    }
  }
}

void check_same(std::string_view field, const std::string& given, const std::string& stored) {
  if (given == stored) return;
  throw StoreError(fmt::format("{} = {} (the campaign file has {})", field, given, stored));
}

// All values are finite: they differ in the sign of a zero if equal, and that the file does not
// keep.
void check_same_values(std::string_view drawn_name, const std::vector<double>& given,
                       const std::vector<double>& stored, std::uint64_t num_runs) {
  if (stored.size() != num_runs) {
    throw StoreError(fmt::format("dispersion.{} = table (the campaign file holds no values for it)",
                                 drawn_name));
  }
  if (given.size() < stored.size()) {
    throw StoreError(fmt::format("dispersion.{} = table of {} values (the campaign file has {})",
                                 drawn_name, given.size(), stored.size()));
  }
  for (std::size_t run = 0; run < stored.size(); ++run) {
    if (given[run] == stored[run]) continue;
    throw StoreError(fmt::format("dispersion.{} = {} (for run {} the campaign file has {})",
                                 drawn_name, given[run], run, stored[run]));
  }
}

void insert_budget_coefficients(Database& database, const Scenario& scenario) {
  Statement insert = database.prepare("INSERT INTO budget_coefficient VALUES (?, ?, ?)");
  const auto coefficients = budget_coefficients(scenario);
  for (std::size_t i = 0; i < num_budget_entries; ++i) {
    for (const ParameterInfo& info : parameter_infos()) {
      const double value = coefficients[i][index(info.parameter)];
      if (value != 0.0) insert.run(budget_entry_infos()[i].name, info.name, value);
    }
  }
}

}  // namespace

void insert_parameters(Database& database, const Scenario& scenario) {
  Statement insert = database.prepare("INSERT INTO parameter VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    insert.run(i + 1, info.name, info.label, info.unit, scenario.objectives[i], info.paper.worst,
               info.paper.mean, info.paper.standard_deviation);
  }
  insert_budget_coefficients(database, scenario);
}

void insert_campaign(Database& database, const Campaign& campaign, std::string_view definition) {
  database
      .prepare(
          "INSERT INTO campaign (campaign_id, name, seed, num_runs, definition, model_version,"
          " build, campaign_uid) VALUES (1, ?, ?, ?, ?, ?, ?, 1 + (random() & ?))")
      .run(campaign.name, std::to_string(campaign.seed), campaign.num_runs, definition,
           model_version, std::string_view(PROOFMASS_BUILD), campaign_uid_max - 1);
  insert_parameters(database, campaign.scenario);
  insert_environment(database, campaign.environment_table);
  insert_dispersion_values(database, campaign, 0);
  write_table_digest(database);
}

EnvironmentTable read_environment_table(const Database& database) {
  Statement select = database.prepare(
      "SELECT time_s, linear_x_m_s2, linear_y_m_s2, linear_z_m_s2,"
      " angular_x_rad_s2, angular_y_rad_s2, angular_z_rad_s2 FROM environment_row ORDER BY "
      "position");
  EnvironmentTable table;
  while (select.step()) {
    table.push_back({.time_s = select.real(0),
                     .linear_m_s2 = {select.real(1), select.real(2), select.real(3)},
                     .angular_rad_s2 = {select.real(4), select.real(5), select.real(6)}});
  }
  return table;
}

std::vector<double> read_dispersion_values(const Database& database, std::string_view drawn_name) {
  Statement select = database.prepare(
      "SELECT value, run_index FROM dispersion_value WHERE quantity = ? ORDER BY 2");
  select.bind_all(drawn_name);
  std::vector<double> values;
  while (select.step()) {
    if (select.count(1) != values.size()) {
      database.refuse_as_damaged(fmt::format("dispersion_value of {}: run {} follows {} values",
                                             drawn_name, select.count(1), values.size()));
    }
    values.push_back(select.real(0));
  }
  return values;
}

void check_extension(const Database& database, const Campaign& campaign) {
  const std::uint64_t num_runs = stored_num_runs(database);
  check_same("campaign.name", campaign.name, database.text("SELECT name FROM campaign"));
  check_same("campaign.seed", std::to_string(campaign.seed),
             database.text("SELECT seed FROM campaign"));
  if (campaign.num_runs < num_runs) {
    throw StoreError(
        fmt::format("campaign.runs = {} (must be at least {}, as in the campaign "
                    "file)",
                    campaign.num_runs, num_runs));
  }
  if (read_environment_table(database) != campaign.environment_table) {
    throw StoreError(
        fmt::format("environment.file = {} (its rows are not those of the campaign file)",
                    campaign.environment_file));
  }
  const std::vector<std::size_t> elements = table_elements(campaign.dispersions);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::string& name = drawn_names()[elements[i]];
    check_same_values(name, campaign.table_columns[i], read_dispersion_values(database, name),
                      num_runs);
  }
}

void extend_campaign(Database& database, const Campaign& campaign, std::string_view definition) {
  insert_dispersion_values(database, campaign, stored_num_runs(database));
  database.prepare("UPDATE campaign SET num_runs = ?, definition = ?")
      .run(campaign.num_runs, definition);
  write_table_digest(database);
}

}  // namespace proofmass::coordinator::detail
