#include "core/microscope/campaign/microscope_campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/results/results.hpp"

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

}  // namespace

void MicroscopeCampaign::validate(TableColumns columns) const {
  check_identity(*this);
  scenario.validate();
  check_environment(*this);
  check_laws(law_set(dispersions));
  check_design(law_set(dispersions), *this);
  if (columns == TableColumns::included) check_table_columns(law_set(dispersions), *this);
}

Interpretation MicroscopeCampaign::interpretation() const {
  if (scenario.noise.scale == 0.0) return Interpretation::ensemble;
  const auto is_fixed = [](const Dispersion& dispersion) { return dispersion.law == Law::fixed; };
  const bool are_fixed = std::ranges::all_of(dispersions, is_fixed);
  return are_fixed ? Interpretation::temporal : Interpretation::mixed;
}

MicroscopeCampaign hardy2013_campaign() {
  MicroscopeCampaign campaign;
  campaign.scenario.estimation.correction = Correction::hardy2013;
  return campaign;
}

double common_offset_x(const Scenario& scenario, const Instrument& instrument) {
  const double error_m_s2 = scenario.drag_free.bias_compensation_error_x_m_s2;
  switch (drag_free_of_a_d11_prime(scenario.sessions)) {
    case DragFreeSource::sensor_1:
      return error_m_s2 - differential_bias_x(instrument);
    case DragFreeSource::sensor_2:
      return error_m_s2 + differential_bias_x(instrument);
    case DragFreeSource::common:
      break;
  }
  return error_m_s2;
}

AcceptedDraw draw_instrument(const MicroscopeCampaign& campaign, RunIndex run,
                             std::span<const double> table_values) {
  const RunIndex of_instrument{run.value / campaign.realisations};
  AcceptedDraw draw;
  while (draw.num_draws < num_draws_max) {
    draw.values = draw_values(campaign.dispersions, campaign.seed, of_instrument, draw.num_draws,
                              table_values, campaign.design);
    ++draw.num_draws;
    if (!is_drawn_in_range(campaign.dispersions, draw.values)) continue;
    const Instrument instrument = make_instrument(draw.values);
    if (is_accepted(instrument, campaign.scenario.acceptance)) {
      draw.instrument = instrument;
      break;
    }
  }
  return draw;
}

}  // namespace proofmass
