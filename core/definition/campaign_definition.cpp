#include "core/definition/campaign_definition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/definition/readers.hpp"

namespace proofmass {
namespace {

constexpr std::string_view environment_key = "environment.file";
constexpr std::size_t values_per_row = 7;

void validate(const Campaign& campaign, TableColumns columns, const Document& document) {
  try {
    if (columns == TableColumns::included) return campaign.validate();
    campaign.validate_without_columns();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
}

Campaign parsed_campaign(const std::string& name, std::string_view text,
                         EnvironmentTable environment_table,
                         std::vector<std::vector<double>> table_columns, TableColumns columns) {
  Document document(name, text, {});
  Campaign campaign = read_definition(document);
  document.check();
  campaign.environment_table = std::move(environment_table);
  campaign.table_columns = std::move(table_columns);
  validate(campaign, columns, document);
  return campaign;
}

std::vector<DataTable> tables_of(const EnvironmentTable& environment) {
  if (environment.empty()) return {};
  DataTable table{.key = std::string(environment_key), .num_columns = values_per_row, .values = {}};
  table.values.reserve(environment.size() * values_per_row);
  for (const EnvironmentRow& row : environment) {
    table.values.push_back(row.time_s);
    table.values.insert(table.values.end(), row.linear_m_s2.begin(), row.linear_m_s2.end());
    table.values.insert(table.values.end(), row.angular_rad_s2.begin(), row.angular_rad_s2.end());
  }
  return {std::move(table)};
}

void check_shape(const DataTable& table) {
  if (table.num_columns == values_per_row && table.values.size() % values_per_row == 0) return;
  throw DefinitionError(
      fmt::format("definition.tables = {} values in {} columns (must be rows of {})",
                  table.values.size(), table.num_columns, values_per_row));
}

EnvironmentTable environment_of(const std::vector<DataTable>& tables) {
  if (tables.empty()) return {};
  if (tables.size() > 1 || tables.front().key != environment_key) {
    throw DefinitionError(fmt::format("definition.tables = {:.100}{} (must be {} alone)",
                                      tables.front().key, tables.size() > 1 ? ", ..." : "",
                                      environment_key));
  }
  check_shape(tables.front());
  const std::vector<double>& values = tables.front().values;
  EnvironmentTable rows(values.size() / values_per_row);
  auto next = values.begin();
  for (EnvironmentRow& row : rows) {
    row.time_s = *next++;
    for (double& value : row.linear_m_s2) value = *next++;
    for (double& value : row.angular_rad_s2) value = *next++;
  }
  return rows;
}

/// The first line where the texts differ, of each.
void require_same_text(std::string_view text, std::string_view canonical) {
  const auto [found, expected] = std::ranges::mismatch(text, canonical);
  if (found == text.end() && expected == canonical.end()) return;
  const auto position = static_cast<std::size_t>(found - text.begin());
  const std::size_t line_begin = canonical.substr(0, position).rfind('\n') + 1;
  const auto line_of = [&](std::string_view whole) {
    const std::string_view rest = whole.substr(line_begin);
    return detail::quoted_text(rest.substr(0, rest.find('\n')).substr(0, 100));
  };
  throw DefinitionError(
      fmt::format("definition:{}: line = {} (must be {}, as the definition has one spelling)",
                  1 + std::ranges::count(canonical.substr(0, line_begin), '\n'), line_of(text),
                  line_of(canonical)));
}

}  // namespace

Campaign read_definition(Document& document) {
  Campaign campaign;
  document.read("campaign.name", campaign.name);
  auto seed = static_cast<std::int64_t>(campaign.seed);
  auto num_runs = static_cast<std::int64_t>(campaign.num_runs);
  document.read("campaign.seed", seed, range::not_negative);
  document.read("campaign.runs", num_runs, range::between(1, static_cast<double>(num_runs_max)));
  campaign.seed = static_cast<std::uint64_t>(seed);
  campaign.num_runs = static_cast<std::uint64_t>(num_runs);
  document.read("environment.file", campaign.environment_file);
  detail::read_scenario(document, campaign.scenario);
  campaign.scenario.sessions = detail::read_sessions(document);
  campaign.dispersions = detail::read_dispersions(document);
  return campaign;
}

Campaign parse_campaign(const std::string& name, std::string_view text,
                        EnvironmentTable environment_table,
                        std::vector<std::vector<double>> table_columns) {
  return parsed_campaign(name, text, std::move(environment_table), std::move(table_columns),
                         TableColumns::included);
}

Definition definition_of(const Campaign& campaign, TableColumns columns) {
  Definition definition{.text = canonical_definition(campaign),
                        .tables = tables_of(campaign.environment_table),
                        .table_columns = {}};
  if (columns == TableColumns::included) definition.table_columns = campaign.table_columns;
  return definition;
}

Campaign campaign_of(Definition definition, TableColumns columns) {
  if (columns == TableColumns::left_out && !definition.table_columns.empty()) {
    throw DefinitionError(fmt::format(
        "definition.table_columns = {} of them (must be none, as they come with the runs)",
        definition.table_columns.size()));
  }
  Campaign campaign =
      parsed_campaign("definition", definition.text, environment_of(definition.tables),
                      std::move(definition.table_columns), columns);
  require_same_text(definition.text, canonical_definition(campaign));
  return campaign;
}

}  // namespace proofmass
