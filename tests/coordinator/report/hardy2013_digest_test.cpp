// The results of the paper's campaign to the last bit, seed 1: whoever changes one of them changes
// the model, and with it model_version.

#include "coordinator/report/read_results.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// What `proofmass report` prints of the first 16 runs; see Digest for the bytes.
std::string digest_of_runs(Correction correction) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.seed = 1;
  campaign.scenario.estimation.correction = correction;
  const RunPlan plan(campaign);
  Digest digest(campaign.results());
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < batch_lanes; ++run) requests.push_back({RunIndex{run}, {}});
  for (const RunResult& result : plan.simulate_batch(requests, best_instruction_set())) {
    digest.add(result);
  }
  return digest.finish().results;
}

TEST(Hardy2013Digest, OfFirstOrderIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::first_order),
            "606fab80776359426ce009161a37cab6ea2334573ee41ac518c873e8a0e861a7");
}

TEST(Hardy2013Digest, OfSecondOrderIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::second_order),
            "f0be33bf95323631cf18b2f6076f726ea2d4d62574fa9d17a76eca374620f60b");
}

TEST(Hardy2013Digest, OfThePapersCorrectionIsThatOfThisModel) {
  EXPECT_EQ(digest_of_runs(Correction::hardy2013),
            "3d77e007322971d2bc09ec04ba87e670e76f907fc108d7c817fcb6b5620ca4f5");
}

}  // namespace
}  // namespace proofmass::coordinator
