#include "core/microscope/campaign/microscope_campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace proofmass {
namespace {

void check_environment(const MicroscopeCampaign& campaign) {
  const bool wants_file = campaign.scenario.environment.kind == EnvironmentKind::file;
  const std::string value = fmt::format("\"{}\"", campaign.environment_file);
  if (campaign.environment_file.size() > data_name_size_max) {
    throw ConfigError("environment.file", fmt::format("{} bytes", campaign.environment_file.size()),
                      fmt::format("must be at most {}", data_name_size_max));
  }
  if (wants_file && campaign.environment_file.empty()) {
    throw ConfigError("environment.file", value, "environment.kind = \"file\" needs one");
  }
  if (!wants_file && !(campaign.environment_file.empty() && campaign.environment_table.empty())) {
    throw ConfigError("environment.file", value, "only with environment.kind = \"file\"");
  }
  if (wants_file) {
    validate_environment_table(campaign.environment_table, campaign.scenario.orbit.period_s);
  }
}

std::string path_of(std::size_t drawn) { return "dispersion." + drawn_names()[drawn]; }

// Far beyond any instrument, and far enough from it for any experiment with the model: an
// offcentring of 5 m is a slip of the pen.
double magnitude_max(std::size_t drawn) {
  const auto group = std::ranges::find_if(draw_groups(), [&](const DrawGroup& one) {
    return drawn >= one.first && drawn < one.first + one.count;
  });
  return 1000.0 * group->bound;
}

void check_magnitude(const std::string& path, std::size_t drawn, double value) {
  const double maximum = magnitude_max(drawn);
  if (std::fabs(value) <= maximum) return;
  throw ConfigError(
      path, fmt::format("{}", value),
      fmt::format("must be in [-{0:.6g}, {0:.6g}], 1000 times the nominal bound", maximum));
}

void check_magnitudes(const Dispersion& law, std::size_t drawn) {
  const std::string path = path_of(drawn);
  check_magnitude(path + ".minimum", drawn, law.minimum);
  check_magnitude(path + ".maximum", drawn, law.maximum);
  check_magnitude(path + ".mean", drawn, law.mean);
  check_magnitude(path + ".standard_deviation", drawn, law.standard_deviation);
  check_magnitude(path + ".value", drawn, law.value);
}

std::vector<TableSource> table_sources(const MicroscopeCampaign& campaign) {
  std::vector<TableSource> sources;
  for (const std::size_t element : campaign.table_quantities()) {
    sources.push_back({.path = path_of(element), .column = campaign.dispersions[element].column});
  }
  return sources;
}

}  // namespace

void MicroscopeCampaign::validate() const {
  validate_without_columns();
  check_table_columns(*this, table_sources(*this));
  for (std::size_t i = 0; const std::size_t drawn : table_quantities()) {
    for (const double value : table_columns[i]) check_magnitude(path_of(drawn), drawn, value);
    ++i;
  }
}

void MicroscopeCampaign::validate_without_columns() const {
  check_identity(*this);
  scenario.validate();
  check_environment(*this);
  for (std::size_t i = 0; i < num_drawn; ++i) {
    dispersions[i].validate(path_of(i));
    check_magnitudes(dispersions[i], i);
  }
}

MicroscopeCampaign hardy2013_campaign() {
  MicroscopeCampaign campaign;
  campaign.name = "hardy2013";
  campaign.seed = 1;
  campaign.num_runs = 100;
  campaign.scenario.estimation.correction = Correction::hardy2013;
  return campaign;
}

}  // namespace proofmass
