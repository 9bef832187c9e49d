#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "core/campaign/run_result.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/results/health.hpp"
#include "core/microscope/results/results.hpp"
#include "core/result_rules.hpp"

namespace proofmass::test {

/// A quantity of MICROSCOPE's results, with its name in the program.
struct ParameterInfo : Quantity {
  Parameter parameter;
};

inline const std::vector<ParameterInfo>& parameter_infos() {
  static const std::vector<ParameterInfo> infos = [] {
    std::vector<ParameterInfo> all;
    for (const Quantity& quantity : microscope_results().quantities) {
      all.push_back({quantity, static_cast<Parameter>(all.size())});
    }
    return all;
  }();
  return infos;
}

/// What the results of MICROSCOPE's nominal campaign are.
inline const ResultSchema& schema() {
  static const ResultSchema results = MicroscopeCampaign().results();
  return results;
}

/// Rules about them.
inline Requirement parse_requirement(std::string_view text) {
  return proofmass::parse_requirement(text, schema());
}
inline StopRule parse_stop_rule(std::string_view text) {
  return proofmass::parse_stop_rule(text, schema());
}

/// The result with a value for every parameter, 0, as far as its status lets them mean something.
inline RunResult zero_result(RunResult result) {
  if (result.has_truth()) result.truth.assign(num_parameters, 0.0);
  if (result.has_estimate()) result.estimate.assign(num_parameters, 0.0);
  return result;
}

/// A campaign of the model that this test is linked with.
inline const MicroscopeCampaign& microscope(const Campaign& campaign) {
  return dynamic_cast<const MicroscopeCampaign&>(campaign);
}

inline Loss loss_of(LossCause cause, SessionTarget session) {
  return {.cause = static_cast<std::uint32_t>(cause),
          .session = static_cast<std::uint32_t>(session)};
}

/// The health of a run that has one.
inline LoopHealth health_of(const RunResult& result) {
  LoopHealth health;
  for (std::size_t i = 0; i < num_health_values; ++i) {
    health.*health_values()[i].member = result.health.at(i);
  }
  return health;
}

inline std::vector<double> values_of(const LoopHealth& health) {
  std::vector<double> values;
  for (const HealthValue& value : health_values()) values.push_back(health.*value.member);
  return values;
}

}  // namespace proofmass::test
