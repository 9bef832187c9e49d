#include "core/campaign/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.hpp"

namespace proofmass {
namespace {

constexpr std::size_t name_length_max = 64;

void check_name(const std::string& name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  if (!name.empty() && name.size() <= name_length_max && std::ranges::all_of(name, allowed)) return;
  throw ConfigError("campaign.name", fmt::format("\"{:.100}\"", name),
                    fmt::format("must be 1 to {} letters, digits, _, - or .", name_length_max));
}

void check_counts(const Campaign& campaign) {
  if (campaign.seed > seed_max) {
    throw ConfigError("campaign.seed", fmt::format("{}", campaign.seed),
                      fmt::format("must be in [0, {}]", seed_max));
  }
  if (campaign.num_runs < 1 || campaign.num_runs > num_runs_max) {
    throw ConfigError("campaign.runs", fmt::format("{}", campaign.num_runs),
                      fmt::format("must be in [1, {}]", num_runs_max));
  }
}

void check_environment(const Campaign& campaign) {
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

void check_table_column(const std::vector<double>& column, const Dispersion& dispersion,
                        const std::string& path, std::uint64_t num_runs) {
  const std::string field = path + ".column";
  const std::string value = fmt::format("\"{}\"", dispersion.column);
  if (column.size() < num_runs) {
    throw ConfigError(field, value,
                      fmt::format("has {} rows, {} runs need one each", column.size(), num_runs));
  }
  const auto bad = std::ranges::find_if_not(column, [](double x) { return std::isfinite(x); });
  if (bad != column.end()) {
    throw ConfigError(field, value, fmt::format("row {} must be finite", bad - column.begin() + 1));
  }
}

std::string path_of(std::size_t drawn) { return "dispersion." + drawn_names()[drawn]; }

void check_table_columns(const Campaign& campaign) {
  const std::vector<std::size_t> elements = table_elements(campaign.dispersions);
  if (campaign.table_columns.size() != elements.size()) {
    throw ConfigError("dispersion", fmt::format("{} columns", campaign.table_columns.size()),
                      fmt::format("laws of kind table are {}", elements.size()));
  }
  for (std::size_t i = 0; i < elements.size(); ++i) {
    check_table_column(campaign.table_columns[i], campaign.dispersions[elements[i]],
                       path_of(elements[i]), campaign.num_runs);
  }
}

}  // namespace

void Campaign::validate() const {
  validate_without_columns();
  check_table_columns(*this);
}

void Campaign::validate_without_columns() const {
  check_name(name);
  check_counts(*this);
  scenario.validate();
  check_environment(*this);
  for (std::size_t i = 0; i < num_drawn; ++i) dispersions[i].validate(path_of(i));
}

std::vector<double> Campaign::table_values(RunIndex run) const {
  std::vector<double> values;
  values.reserve(table_columns.size());
  for (const std::vector<double>& column : table_columns) {
    PROOFMASS_EXPECT(run.value < column.size());
    values.push_back(column[run.value]);
  }
  return values;
}

Campaign hardy2013_campaign() {
  Campaign campaign;
  campaign.name = "hardy2013";
  campaign.seed = 1;
  campaign.num_runs = 100;
  campaign.scenario.estimation.correction = Correction::hardy2013;
  return campaign;
}

}  // namespace proofmass
