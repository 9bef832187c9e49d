#include "core/microscope/simulation/reference_digest.hpp"

#include <bit>
#include <memory>
#include <vector>

#include "core/campaign/device.hpp"
#include "core/math/hash.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass {
namespace {

/// Every session of the paper's campaign for one orbit: each line of a kernel is passed through. A
/// sample every two seconds, more than campaign files allow, is enough for stable loops, and makes
/// more than one block of weights. The loops settle for a whole number of the noise's blocks, as
/// sessions side by side ask for.
MicroscopeCampaign reference_campaign() {
  MicroscopeCampaign campaign;
  campaign.seed = 1;
  campaign.num_runs = batch_lanes;
  campaign.scenario.simulation.sample_period_s = 2.0;
  campaign.scenario.simulation.settling_s = 104.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  return campaign;
}

/// Sizes of batches that together have all runs of the campaign and pass through every kernel of a
/// set: for full batches, for few runs, and for sessions side by side.
std::vector<std::size_t> batch_sizes(InstructionSet set) {
  if (set == InstructionSet::avx512) return {9, 5, 2};
  if (set == InstructionSet::avx2) return {10, 4, 2};
  return {batch_lanes};
}

}  // namespace

namespace {

void add_to(std::uint64_t& hash, const RunResult& result) {
  const auto add = [&](double value) { hash = fnv1a(hash, std::bit_cast<std::uint64_t>(value)); };
  for (const double value : result.truth) add(value);
  for (const double value : result.estimate) add(value);
}

}  // namespace

std::uint64_t reference_digest(InstructionSet set) {
  const RunPlan plan(reference_campaign());
  std::uint64_t hash = fnv1a_basis;
  std::uint64_t next_run = 0;
  for (const std::size_t size : batch_sizes(set)) {
    std::vector<RunRequest> requests;
    for (std::size_t i = 0; i < size; ++i) requests.push_back({RunIndex{next_run++}, {}});
    for (const RunResult& result : plan.simulate_batch(requests, set)) add_to(hash, result);
  }
  return hash;
}

std::optional<Model::DeviceProof> prove_device(Device& device) {
  const RunPlan plan(reference_campaign());
  if (!plan.runs_on_devices()) return std::nullopt;
  const std::unique_ptr<DeviceSimulation> simulation = plan.simulation_on(device);
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < batch_lanes; ++run) requests.push_back({RunIndex{run}, {}});
  simulation->add(0, requests);
  Model::DeviceProof proof{.digest = fnv1a_basis, .capacity = simulation->capacity()};
  while (simulation->num_in_flight() > 0) {
    for (const DeviceSimulation::Ended& ended : simulation->advance()) {
      for (const RunResult& result : ended.results) add_to(proof.digest, result);
    }
  }
  return proof;
}

}  // namespace proofmass
