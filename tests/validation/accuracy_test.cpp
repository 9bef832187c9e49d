// The campaign of [Hardy2013]: mean errors over random draws, against an independent prototype of
// the same model and against the paper's table of 100 simulations.

#include <gtest/gtest.h>

#include <vector>

#include "core/campaign/statistics.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t num_runs = 96;

/// Mean |error| of 100 draws of an independent scalar prototype of this model, SI, in the order of
/// Parameter.
constexpr ParameterArray prototype_first_order{15e-9,   15e-9,   53e-9,   2.7e-4, 2.8e-4,
                                               0.36e-6, 0.17e-6, 0.21e-6, 26.0,   45.0};
constexpr ParameterArray prototype_second_order{7.5e-9,  6.5e-9,  53e-9,   2.7e-4, 2.8e-4,
                                                0.36e-6, 0.17e-6, 0.21e-6, 18.0,   7.8};

/// Batches give the bits of the scalar reference in a tenth of its time.
CampaignStatistics statistics_of(Correction correction) {
  MicroscopeCampaign campaign;
  campaign.seed = 20130501;
  campaign.scenario.estimation.correction = correction;
  const RunPlan plan(campaign);
  StatisticsAccumulator statistics(campaign.objectives());
  for (std::uint64_t first = 0; first < num_runs; first += batch_lanes) {
    std::vector<RunRequest> requests;
    for (std::uint64_t i = 0; i < batch_lanes; ++i) requests.push_back({RunIndex{first + i}, {}});
    for (const RunResult& result : plan.simulate_batch(requests, best_instruction_set())) {
      statistics.add(result);
    }
  }
  return statistics.statistics();
}

/// The mean of n absolute errors scatters by std/√n, about 0.8/√96 = 8 % here (13 % where the error
/// is a product of two drawn quantities), so a factor 2 is eight (five) standard errors wide.
void expect_within_factor(const CampaignStatistics& statistics, const ParameterArray& expected,
                          double factor) {
  EXPECT_EQ(statistics.num_estimated, num_runs);
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    const double ratio =
        statistics.accuracy[index(info.parameter)].mean / expected[index(info.parameter)];
    EXPECT_GT(ratio, 1.0 / factor) << info.name;
    EXPECT_LT(ratio, factor) << info.name;
  }
}

TEST(Accuracy, FirstOrderMeansAreThoseOfThePrototype) {
  expect_within_factor(statistics_of(Correction::first_order), prototype_first_order, 2.0);
}

TEST(Accuracy, SecondOrderMeansAreThoseOfThePrototype) {
  expect_within_factor(statistics_of(Correction::second_order), prototype_second_order, 2.0);
}

TEST(Accuracy, FirstOrderMeansAreThePapersWhereItSaysWhatItDid) {
  using enum Parameter;
  const CampaignStatistics statistics = statistics_of(Correction::first_order);
  for (const Parameter parameter : {k2d, k2c, a_c12, a_c13, a_c11_delta_x, a_c11_delta_y}) {
    const test::ParameterInfo& info = test::parameter_infos()[index(parameter)];
    const double ratio = statistics.accuracy[index(parameter)].mean / info.published->mean;
    EXPECT_GT(ratio, 1.0 / 1.7) << info.name;
    EXPECT_LT(ratio, 1.7) << info.name;
  }
}

}  // namespace
}  // namespace proofmass
