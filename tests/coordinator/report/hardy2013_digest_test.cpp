// The results of the paper's campaign to the last bit, seed 1: whoever changes one of them changes
// the model, and with it model_version.

#include "coordinator/report/read_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

MicroscopeCampaign campaign_of(Correction correction) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.seed = 1;
  campaign.scenario.estimation.correction = correction;
  return campaign;
}

// What `proofmass report` prints of the first 16 runs; see Digest for the bytes. The correction is
// one of the records, which are the same for all.
TEST(Hardy2013Digest, OfEachCorrectionIsThatOfThisModel) {
  const std::vector<RunRecord> records =
      test::recorded(RunPlan(campaign_of(Correction::first_order)), batch_lanes);
  for (const auto& [correction, expected] :
       {std::pair(Correction::first_order,
                  "606fab80776359426ce009161a37cab6ea2334573ee41ac518c873e8a0e861a7"),
        std::pair(Correction::second_order,
                  "f0be33bf95323631cf18b2f6076f726ea2d4d62574fa9d17a76eca374620f60b"),
        std::pair(Correction::hardy2013,
                  "3d77e007322971d2bc09ec04ba87e670e76f907fc108d7c817fcb6b5620ca4f5")}) {
    const MicroscopeCampaign campaign = campaign_of(correction);
    const RunPlan plan(campaign);
    Digest digest(campaign.results());
    for (const RunRecord& record : records) digest.add(plan.estimate(record));
    EXPECT_EQ(digest.finish().results, expected);
  }
}

}  // namespace
}  // namespace proofmass::coordinator
