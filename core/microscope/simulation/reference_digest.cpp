#include "core/microscope/simulation/reference_digest.hpp"

#include <bit>
#include <vector>

#include "core/math/hash.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass {
namespace {

/// Every session of the paper's campaign for one orbit: each line of the kernel is passed through.
MicroscopeCampaign reference_campaign() {
  MicroscopeCampaign campaign;
  campaign.seed = 1;
  campaign.num_runs = 3;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  return campaign;
}

std::vector<RunResult> results(const RunPlan& plan, InstructionSet set) {
  const std::vector<RunRequest> requests{{RunIndex{0}, {}}, {RunIndex{1}, {}}, {RunIndex{2}, {}}};
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
  for (const RunResult& result : results(plan, set)) {
    for (const double value : result.truth) add(value);
    for (const double value : result.estimate) add(value);
  }
  return hash;
}

}  // namespace proofmass
