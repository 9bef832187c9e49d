#include <cstdint>
#include <string>

#include "coordinator/campaign_file/readers.hpp"

namespace proofmass::coordinator::detail {
namespace {

struct FieldReader {
  Document& document;

  void operator()(const FieldInfo& field, double& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  void operator()(const FieldInfo& field, std::int64_t& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  template <typename Choice>
  void operator()(const FieldInfo& field, Choice& value) const {
    document.read(std::string(field.path), value);
  }
};

}  // namespace

void read_scenario(Document& document, Scenario& scenario) {
  // The preset sets the values that the other keys of noise then replace.
  NoisePreset preset = scenario.noise.preset;
  document.read("noise.preset", preset);
  scenario.noise = noise_preset(preset);
  for_each_field(scenario, FieldReader{document});
}

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
  read_scenario(document, campaign.scenario);
  campaign.scenario.sessions = read_sessions(document);
  campaign.dispersions = read_dispersions(document);
  return campaign;
}

}  // namespace proofmass::coordinator::detail
