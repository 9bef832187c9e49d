// The results of the paper's campaign to the last bit, seed 1: whoever changes one of them changes
// the model, and with it model_version.

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/read_results.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// What `proofmass report` prints of the first `num_runs` runs; see Digest for the bytes.
std::string digest_of_runs(Correction correction, std::uint64_t num_runs) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.seed = 1;
  campaign.scenario.estimation.correction = correction;
  const RunPlan plan(campaign);
  Digest digest(campaign.results());
  for (std::uint64_t first = 0; first < num_runs; first += batch_lanes) {
    std::vector<RunRequest> requests;
    const std::uint64_t end = std::min<std::uint64_t>(num_runs, first + batch_lanes);
    for (std::uint64_t run = first; run < end; ++run) requests.push_back({RunIndex{run}, {}});
    for (const RunResult& result : plan.simulate_batch(requests, best_instruction_set())) {
      digest.add(result);
    }
  }
  return digest.finish().results;
}

TEST(Hardy2013Digest, OfFirstOrderIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::first_order, 100),
            "f98563e5cdc1b4972438ed4fb95fefe75f5fdcb44c9eec91b49717062cf2703d");
}

TEST(Hardy2013Digest, OfSecondOrderIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::second_order, 16),
            "f0be33bf95323631cf18b2f6076f726ea2d4d62574fa9d17a76eca374620f60b");
}

TEST(Hardy2013Digest, OfThePapersCorrectionIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::hardy2013, 16),
            "3d77e007322971d2bc09ec04ba87e670e76f907fc108d7c817fcb6b5620ca4f5");
}

}  // namespace
}  // namespace proofmass::coordinator
