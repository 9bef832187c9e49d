#include <fmt/format.h>

#include "core/campaign/model.hpp"
#include "core/definition/csv.hpp"
#include "core/definition/document.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/definition/environment_reader.hpp"

namespace proofmass {
namespace {

void read_environment(MicroscopeCampaign& campaign, DataFiles& files) {
  if (campaign.scenario.environment.kind != EnvironmentKind::file) return;
  if (campaign.environment_file.empty()) return;  // validate() says what is missing.
  const std::string& text = files.text_of(campaign.environment_file, "environment.file");
  campaign.environment_table = detail::parse_environment(
      text, files.name_of(campaign.environment_file), campaign.scenario.orbit.period_s);
}

void read_columns(MicroscopeCampaign& campaign, DataFiles& files) {
  for (const std::size_t element : campaign.table_quantities()) {
    const Dispersion& dispersion = campaign.dispersions[element];
    const std::string path = fmt::format("dispersion.{}.file", drawn_names()[element]);
    campaign.table_columns.push_back(parse_column(
        files.text_of(dispersion.file, path), files.name_of(dispersion.file), dispersion.column));
  }
}

}  // namespace

MicroscopeCampaign read_campaign(Document& document, DataFiles& files) {
  MicroscopeCampaign campaign = read_definition(document);
  document.check();
  read_environment(campaign, files);
  read_columns(campaign, files);
  try {
    campaign.validate();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

}  // namespace proofmass
