#include "core/microscope/definition/campaign_definition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"

namespace proofmass {
namespace {

void validate(const MicroscopeCampaign& campaign, TableColumns columns, const Document& document) {
  try {
    if (columns == TableColumns::included) return campaign.validate();
    campaign.validate_without_columns();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
}

MicroscopeCampaign parsed_campaign(const std::string& name, std::string_view text,
                                   EnvironmentTable environment_table,
                                   std::vector<std::vector<double>> table_columns,
                                   TableColumns columns) {
  Document document(name, text, {});
  MicroscopeCampaign campaign = read_definition(document);
  document.check();
  campaign.environment_table = std::move(environment_table);
  campaign.table_columns = std::move(table_columns);
  validate(campaign, columns, document);
  return campaign;
}

/// The first line where the texts differ, of each.
void require_same_text(std::string_view source, std::string_view text, std::string_view canonical) {
  const auto [found, expected] = std::ranges::mismatch(text, canonical);
  if (found == text.end() && expected == canonical.end()) return;
  const auto position = static_cast<std::size_t>(found - text.begin());
  const std::size_t line_begin = canonical.substr(0, position).rfind('\n') + 1;
  const auto line_of = [&](std::string_view whole) {
    const std::string_view rest = whole.substr(line_begin);
    return detail::quoted_text(rest.substr(0, rest.find('\n')).substr(0, 100));
  };
  throw DefinitionError(
      fmt::format("{}:{}: line = {} (must be {}, as the definition has one spelling)", source,
                  1 + std::ranges::count(canonical.substr(0, line_begin), '\n'), line_of(text),
                  line_of(canonical)));
}

}  // namespace

MicroscopeCampaign parse_campaign(const std::string& name, std::string_view text,
                                  EnvironmentTable environment_table,
                                  std::vector<std::vector<double>> table_columns) {
  return parsed_campaign(name, text, std::move(environment_table), std::move(table_columns),
                         TableColumns::included);
}

Definition definition_of(const MicroscopeCampaign& campaign, TableColumns columns) {
  Definition definition{.text = canonical_definition(campaign),
                        .tables = tables_of(campaign.environment_table),
                        .table_columns = {}};
  if (columns == TableColumns::included) definition.table_columns = campaign.table_columns;
  return definition;
}

MicroscopeCampaign campaign_of(Definition definition, TableColumns columns,
                               std::string_view source) {
  if (columns == TableColumns::left_out && !definition.table_columns.empty()) {
    throw DefinitionError(fmt::format(
        "definition.table_columns = {} of them (must be none, as they come with the runs)",
        definition.table_columns.size()));
  }
  MicroscopeCampaign campaign =
      parsed_campaign(std::string(source), definition.text, environment_of(definition.tables),
                      std::move(definition.table_columns), columns);
  require_same_text(source, definition.text, canonical_definition(campaign));
  return campaign;
}

}  // namespace proofmass
