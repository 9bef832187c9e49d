#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/definition/document.hpp"
#include "core/microscope/definition/campaign_definition.hpp"

namespace proofmass::test {

/// The campaign of a text, in canonical form or not, and of data that have been read before.
///
/// @param environment_table  Rows of the environment file; empty if harmonic.
/// @param table_columns      As in Campaign::table_columns.
/// @throws DefinitionError if they are not those of a valid campaign.
[[nodiscard]] inline MicroscopeCampaign parse_campaign(
    const std::string& name, std::string_view text, EnvironmentTable environment_table = {},
    std::vector<std::vector<double>> table_columns = {}) {
  Document document(name, text, {});
  MicroscopeCampaign campaign = read_definition(document);
  document.check();
  campaign.environment_table = std::move(environment_table);
  campaign.table_columns = std::move(table_columns);
  try {
    campaign.validate();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

}  // namespace proofmass::test
