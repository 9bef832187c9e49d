#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass::test {

/// The law of a drawn quantity.
/// @throws std::out_of_range if none has this name.
inline Dispersion& law_of(MicroscopeCampaign& campaign, std::string_view name) {
  const auto found = std::ranges::find(drawn_names(), name) - drawn_names().begin();
  return campaign.dispersions.at(static_cast<std::size_t>(found));
}

inline Dispersion fixed_law(double value) {
  Dispersion law;
  law.law = Law::fixed;
  law.value = value;
  return law;
}

/// Fixes a drawn quantity.
inline void fix(MicroscopeCampaign& campaign, std::string_view name, double value) {
  law_of(campaign, name) = fixed_law(value);
}

/// An instrument without errors: every drawn quantity is 0.
inline DispersionSet perfect_laws() {
  DispersionSet laws;
  laws.fill(fixed_law(0.0));
  return laws;
}

/// The paper's campaign with a sample a second: excitations and loops are far slower, and a run
/// takes a quarter of the time.
inline MicroscopeCampaign coarse_campaign() {
  MicroscopeCampaign campaign;
  campaign.scenario.simulation.sample_period_s = 1.0;
  return campaign;
}

/// Successive runs of a campaign without tables.
inline std::vector<RunRequest> requests_from(std::uint64_t first, std::size_t count) {
  std::vector<RunRequest> requests;
  for (std::size_t i = 0; i < count; ++i) requests.push_back({RunIndex{first + i}, {}});
  return requests;
}

/// What `compute` makes of the first runs of a campaign, batch by batch.
template <typename Compute>
auto in_batches(std::uint64_t num_runs, const Compute& compute) {
  decltype(compute(std::vector<RunRequest>{})) all;
  for (std::uint64_t first = 0; first < num_runs; first += batch_lanes) {
    const std::uint64_t count = std::min<std::uint64_t>(batch_lanes, num_runs - first);
    for (auto& one : compute(requests_from(first, count))) all.push_back(std::move(one));
  }
  return all;
}

inline std::vector<RunResult> simulated(const RunPlan& plan, std::uint64_t num_runs) {
  return in_batches(num_runs, [&](const std::vector<RunRequest>& requests) {
    return plan.simulate_batch(requests, best_instruction_set());
  });
}

inline std::vector<RunRecord> recorded(const RunPlan& plan, std::uint64_t num_runs) {
  return in_batches(num_runs, [&](const std::vector<RunRequest>& requests) {
    return plan.record_batch(requests, best_instruction_set());
  });
}

/// Every number of a result, so that signs of zeros and kinds of NaN count.
inline std::vector<std::uint64_t> bits_of(const RunResult& result) {
  std::vector<std::uint64_t> bits{result.run.value,  static_cast<std::uint64_t>(result.status),
                                  result.num_draws,  result.num_rounds,
                                  result.loss.cause, result.loss.session};
  for (const auto* const values : {&result.truth, &result.estimate, &result.standard_error,
                                   &result.fit, &result.correlations, &result.health}) {
    bits.push_back(values->size());
    for (const double value : *values) bits.push_back(std::bit_cast<std::uint64_t>(value));
  }
  return bits;
}

}  // namespace proofmass::test
