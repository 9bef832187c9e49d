#include "core/microscope/simulation/reference_digest.hpp"

#include <bit>
#include <vector>

#include "core/math/hash.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass {
namespace {

/// Every session of the paper's campaign for one orbit with a sample a second: each line of a
/// kernel is passed through.
MicroscopeCampaign reference_campaign() {
  MicroscopeCampaign campaign;
  campaign.seed = 1;
  campaign.num_runs = batch_lanes;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  return campaign;
}

std::vector<RunResult> results(const RunPlan& plan, InstructionSet set, std::size_t count) {
  std::vector<RunRequest> requests;
  for (std::size_t run = 0; run < count; ++run) requests.push_back({RunIndex{run}, {}});
  if (set != InstructionSet::scalar) return plan.simulate_batch(requests, set);
  std::vector<RunResult> results;
  for (const RunRequest& request : requests) results.push_back(plan.simulate(request.run, {}));
  return results;
}

}  // namespace

std::uint64_t reference_digest(InstructionSet set) {
  const RunPlan plan(reference_campaign());
  std::uint64_t hash = fnv1a_basis;
  const auto add = [&](double value) { hash = fnv1a(hash, std::bit_cast<std::uint64_t>(value)); };
  // For the kernels of full batches, of narrow ones and of sessions side by side.
  for (const std::size_t count :
       {batch_lanes / 2 + 1, batch_lanes / 2, std::size_t{3}, std::size_t{1}}) {
    for (const RunResult& result : results(plan, set, count)) {
      for (const double value : result.truth) add(value);
      for (const double value : result.estimate) add(value);
    }
  }
  return hash;
}

}  // namespace proofmass
