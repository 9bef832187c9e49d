#pragma once

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::test {

/// The paper's campaign with sessions of five orbits at 1 Hz: a batch takes a tenth of a second.
inline MicroscopeCampaign quick_campaign(std::uint64_t num_runs) {
  MicroscopeCampaign campaign = campaign_of(num_runs);
  campaign.scenario.simulation.sample_period_s = 1.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 5;
  return campaign;
}

/// The results that the runs of a campaign have.
inline std::vector<RunResult> simulated(const MicroscopeCampaign& campaign) {
  const RunPlan plan(campaign);
  std::vector<RunResult> results;
  for (std::uint64_t run = 0; run < campaign.num_runs;) {
    std::vector<RunRequest> requests;
    for (; run < campaign.num_runs && requests.size() < batch_lanes; ++run) {
      requests.push_back({RunIndex{run}, campaign.table_values(RunIndex{run})});
    }
    const auto batch = plan.simulate_batch(requests, best_instruction_set());
    results.insert(results.end(), batch.begin(), batch.end());
  }
  return results;
}

/// A file with these results of a campaign, without statistics.
inline coordinator::Store store_of(const std::filesystem::path& file,
                                   const MicroscopeCampaign& campaign,
                                   const std::vector<RunResult>& results) {
  using namespace coordinator;
  Store store = Store::create(file, campaign, canonical_definition(campaign));
  const Entry worker = worker_1();
  (void)store.write({&worker, 1});
  std::vector<Delivery> deliveries;
  for (const RunResult& result : results) {
    deliveries.push_back({.result = result, .worker = session_1, .attempt = {1}, .compute_s = 0.5});
  }
  (void)store.commit(deliveries);
  return store;
}

/// Results of status 1 to 4 in turn, of the runs [0, count).
inline std::vector<RunResult> results_of_each_status(std::uint64_t count) {
  std::vector<RunResult> results;
  for (std::uint64_t run = 0; run < count; ++run) {
    results.push_back(result_of(run, static_cast<RunStatus>(1 + run % 4)));
  }
  return results;
}

inline std::uint64_t bits_of(double value) { return std::bit_cast<std::uint64_t>(value); }

inline void never_stopped() {}
[[noreturn]] inline void stopped_at_once() { throw coordinator::Interrupted(); }

/// Text of the Error that `action` throws; empty if it throws none.
inline std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace proofmass::test
