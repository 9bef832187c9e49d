#include "core/statistics/variance_components.hpp"

#include "core/random/normal.hpp"
#include "core/random/stream.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

OneWayAnalysis analysis_of(const std::vector<std::vector<double>>& groups) {
  GroupedValues values(groups.front().size());
  for (const std::vector<double>& group : groups) values.add(group);
  return values.analysis(0.95);
}

// Means 2, 4 and 6 about 4: between 3·(4 + 0 + 4)/2 = 12; within (2 + 8 + 18)/6 = 14/3; F = 18/7.
// With 2 and 6 degrees of freedom P(F > f) = (1 + f/3)^-3, whose inverse is f = 3 (P^(-1/3) - 1).
TEST(OneWayAnalysis, AgreesWithATableComputedByHand) {
  const OneWayAnalysis of = analysis_of({{1.0, 2.0, 3.0}, {2.0, 4.0, 6.0}, {3.0, 6.0, 9.0}});
  EXPECT_EQ(of.num_groups, 3U);
  EXPECT_DOUBLE_EQ(of.mean, 4.0);
  EXPECT_DOUBLE_EQ(of.between_mean_square, 12.0);
  EXPECT_DOUBLE_EQ(of.within_mean_square, 14.0 / 3.0);
  EXPECT_NEAR(of.p_value, std::pow(13.0 / 7.0, -3.0), 1e-12);
  EXPECT_NEAR(of.between_deviation, std::sqrt(22.0 / 9.0), 1e-12);
  EXPECT_NEAR(of.within_deviation, std::sqrt(14.0 / 3.0), 1e-12);
  EXPECT_NEAR(of.within_share, (14.0 / 3.0) / (14.0 / 3.0 + 22.0 / 9.0), 1e-12);
  // Student's law with 2 degrees: t = (2p - 1)/sqrt(2 p (1 - p)); the means have variance 4.
  const double half_width = 0.95 / std::sqrt(2.0 * 0.975 * 0.025) * std::sqrt(4.0 / 3.0);
  EXPECT_NEAR(of.mean_interval->lower, 4.0 - half_width, 1e-9);
  EXPECT_NEAR(of.mean_interval->upper, 4.0 + half_width, 1e-9);
  const double f = 18.0 / 7.0;
  const double f_low = 3.0 * (std::pow(0.975, -1.0 / 3.0) - 1.0);
  const double f_high = 3.0 * (std::pow(0.025, -1.0 / 3.0) - 1.0);
  EXPECT_NEAR(of.within_share_interval->lower, 1.0 / (1.0 + (f / f_low - 1.0) / 3.0), 1e-9);
  EXPECT_EQ(of.within_share_interval->upper, 1.0);  // F is below the quantile.
  ASSERT_LT(f, f_high);
  // The chi-square law with 2 degrees has the quantile -2 ln(1 - P).
  EXPECT_NEAR(of.between_interval->upper,
              std::sqrt(24.0 * (1.0 - f_low / f) / (3.0 * -2.0 * std::log(0.975))), 1e-9);
  EXPECT_EQ(of.between_interval->lower, 0.0);
}

TEST(OneWayAnalysis, KnowsNoIntervalOfOneGroupOrWithoutNoise) {
  const OneWayAnalysis one = analysis_of({{1.0, 3.0}});
  EXPECT_FALSE(one.mean_interval);
  EXPECT_FALSE(one.within_share_interval);
  EXPECT_DOUBLE_EQ(one.within_mean_square, 2.0);
  const OneWayAnalysis silent = analysis_of({{1.0, 1.0}, {3.0, 3.0}});
  EXPECT_FALSE(silent.within_share_interval);
  EXPECT_EQ(silent.within_share, 0.0);
  EXPECT_DOUBLE_EQ(silent.between_deviation, std::sqrt(2.0));
}

/// Values in (0, 1) of one repetition.
class Uniforms {
 public:
  explicit Uniforms(std::uint64_t repetition) : stream_(7, RunIndex{repetition}, stream_id("u")) {}
  double next() { return uniform(stream_.block(index_++)); }
  double deviate() { return inverse_normal(next()); }

 private:
  RandomStream stream_;
  std::uint32_t index_ = 0;
};

constexpr std::uint64_t num_repetitions = 2000;
// A share of 95 % has a standard error of 0.5 %: four of them.
constexpr double lowest = 0.93, highest = 0.97;

struct Coverage {
  std::uint64_t count = 0;
  void add(const std::optional<Interval>& interval, double truth) {
    if (interval && interval->lower <= truth && truth <= interval->upper) ++count;
  }
  [[nodiscard]] double share() const {
    return static_cast<double>(count) / static_cast<double>(num_repetitions);
  }
};

TEST(OneWayAnalysis, CoversKnownVariances) {
  constexpr double between = 1.0, within = 2.0, mean = 5.0;
  Coverage of_mean, of_between, of_within, of_share;
  double sum_of_p = 0.0;
  for (std::uint64_t i = 0; i < num_repetitions; ++i) {
    Uniforms random(i);
    GroupedValues values(4), same(4);
    for (int group = 0; group < 30; ++group) {
      const double centre = mean + between * random.deviate();
      std::vector<double> noise(4);
      for (double& value : noise) value = within * random.deviate();
      same.add(noise);
      for (double& value : noise) value += centre;
      values.add(noise);
    }
    const OneWayAnalysis analysis = values.analysis(0.95);
    of_mean.add(analysis.mean_interval, mean);
    of_between.add(analysis.between_interval, between);
    of_within.add(analysis.within_interval, within);
    of_share.add(analysis.within_share_interval, 0.8);
    sum_of_p += same.analysis(0.95).p_value;
  }
  for (const Coverage& coverage : {of_mean, of_within, of_share}) {
    EXPECT_GE(coverage.share(), lowest);
    EXPECT_LE(coverage.share(), highest);
  }
  EXPECT_GE(of_between.share(), lowest);
  // Without a variance between groups, p is uniform: its mean has a standard error of 0.0065.
  EXPECT_NEAR(sum_of_p / num_repetitions, 0.5, 4.0 * 0.0065);
}

/// Coverage for 200 groups of five members, each hit with the probability of its group: `rare`, or
/// `often` in a tenth of the groups.
double probability_coverage(double rare, double often) {
  constexpr std::size_t size = 5;
  Coverage coverage;
  for (std::uint64_t i = 0; i < num_repetitions; ++i) {
    Uniforms random(i);
    MomentSums shares(0.0);
    for (int group = 0; group < 200; ++group) {
      const double probability = random.next() < 0.1 ? often : rare;
      int hits = 0;
      for (std::size_t k = 0; k < size; ++k) hits += random.next() < probability ? 1 : 0;
      shares.add(static_cast<double>(hits) / size);
    }
    coverage.add(grouped_probability_interval(shares.moments(), size, 0.95),
                 0.9 * rare + 0.1 * often);
  }
  return coverage.share();
}

// Clopper-Pearson is conservative where hits are few.
TEST(GroupedProbabilityInterval, CoversWhatDependsOnItsGroup) {
  EXPECT_GE(probability_coverage(0.02, 0.9), lowest);
  EXPECT_LE(probability_coverage(0.02, 0.9), 0.985);
  EXPECT_GE(probability_coverage(0.05, 0.05), lowest);
  EXPECT_GE(probability_coverage(0.0, 1.0), lowest);
}

// 0 of 20 groups say no more than 20 independent runs.
TEST(GroupedProbabilityInterval, CountsGroupsWhereNothingTellsTheirMembersApart) {
  MomentSums shares(0.0);
  for (int i = 0; i < 20; ++i) shares.add(0.0);
  const Interval interval = grouped_probability_interval(shares.moments(), 50, 0.95);
  EXPECT_EQ(interval.lower, 0.0);
  EXPECT_NEAR(interval.upper, 1.0 - std::pow(0.025, 1.0 / 20.0), 1e-9);
}

}  // namespace
}  // namespace proofmass
