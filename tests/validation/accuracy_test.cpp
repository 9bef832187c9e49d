// The campaign of [Hardy2013]: mean errors over random draws, against an independent prototype of
// the same model and against the paper's table of 100 simulations.

#include <gtest/gtest.h>

#include <array>

#include "core/campaign/statistics.hpp"
#include "core/simulation/run.hpp"

namespace proofmass {
namespace {

constexpr int num_runs = 40;

/// Mean |error| of 100 draws of an independent scalar prototype of this model, SI, in the order of
/// Parameter.
constexpr ParameterArray prototype_first_order{15e-9,   15e-9,   53e-9,   2.7e-4, 2.8e-4,
                                               0.36e-6, 0.17e-6, 0.21e-6, 26.0,   45.0};
constexpr ParameterArray prototype_second_order{7.5e-9,  6.5e-9,  53e-9,   2.7e-4, 2.8e-4,
                                                0.36e-6, 0.17e-6, 0.21e-6, 18.0,   7.8};

struct Means {
  CampaignStatistics first_order;
  CampaignStatistics second_order;
};

/// Both corrections from the same simulated records.
const Means& means() {
  static const Means result = [] {
    Campaign campaign;
    campaign.seed = 20130501;
    campaign.scenario.estimation.correction = Correction::first_order;
    const RunPlan first(campaign);
    campaign.scenario.estimation.correction = Correction::second_order;
    const RunPlan second(campaign);
    StatisticsAccumulator first_statistics(campaign.scenario.objectives);
    StatisticsAccumulator second_statistics(campaign.scenario.objectives);
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      const RunRecord record = first.record(RunIndex{run}, {});
      first_statistics.add(first.estimate(record));
      second_statistics.add(second.estimate(record));
    }
    return Means{first_statistics.statistics(), second_statistics.statistics()};
  }();
  return result;
}

/// The mean of n absolute errors scatters by std/√n, about 0.8/√40 = 13 % here (20 % where the
/// error is a product of two drawn quantities), so a factor 2 is five (three) standard errors wide.
void expect_within_factor(const CampaignStatistics& statistics, const ParameterArray& expected,
                          double factor) {
  EXPECT_EQ(statistics.num_estimated, static_cast<std::uint64_t>(num_runs));
  for (const ParameterInfo& info : parameter_infos()) {
    const double ratio =
        statistics.accuracy[index(info.parameter)].mean / expected[index(info.parameter)];
    EXPECT_GT(ratio, 1.0 / factor) << info.name;
    EXPECT_LT(ratio, factor) << info.name;
  }
}

TEST(Accuracy, FirstOrderMeansAreThoseOfThePrototype) {
  expect_within_factor(means().first_order, prototype_first_order, 2.0);
}

TEST(Accuracy, SecondOrderMeansAreThoseOfThePrototype) {
  expect_within_factor(means().second_order, prototype_second_order, 2.0);
}

TEST(Accuracy, FirstOrderMeansAreThePapersWhereItSaysWhatItDid) {
  using enum Parameter;
  for (const Parameter parameter : {k2d, k2c, a_c12, a_c13, a_c11_delta_x, a_c11_delta_y}) {
    const ParameterInfo& info = parameter_infos()[index(parameter)];
    const double ratio = means().first_order.accuracy[index(parameter)].mean / info.paper.mean;
    EXPECT_GT(ratio, 1.0 / 1.7) << info.name;
    EXPECT_LT(ratio, 1.7) << info.name;
  }
}

}  // namespace
}  // namespace proofmass
