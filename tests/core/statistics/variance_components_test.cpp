#include "core/statistics/variance_components.hpp"

#include "core/random/stream.hpp"
#include "core/statistics/distribution.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

OneWayAnalysis analysis_of(const std::vector<std::vector<double>>& groups) {
  GroupedValues values(groups.front().size());
  for (const std::vector<double>& group : groups) values.add(group);
  return values.analysis(0.95);
}

// Means 2, 4 and 6 about 4: between 3·(4 + 0 + 4)/2 = 12; within (2 + 8 + 18)/6 = 14/3.
TEST(OneWayAnalysis, AgreesWithATableComputedByHand) {
  const OneWayAnalysis of = analysis_of({{1.0, 2.0, 3.0}, {2.0, 4.0, 6.0}, {3.0, 6.0, 9.0}});
  EXPECT_EQ(of.num_groups, 3U);
  EXPECT_DOUBLE_EQ(of.mean, 4.0);
  EXPECT_DOUBLE_EQ(of.between_mean_square.value(), 12.0);
  EXPECT_DOUBLE_EQ(of.within_mean_square, 14.0 / 3.0);
  EXPECT_NEAR(of.between_deviation.value(), std::sqrt(22.0 / 9.0), 1e-12);
  EXPECT_NEAR(of.within_deviation, std::sqrt(14.0 / 3.0), 1e-12);
  EXPECT_NEAR(of.within_share.value(), (14.0 / 3.0) / (14.0 / 3.0 + 22.0 / 9.0), 1e-12);
  // Student's law with 2 degrees: t = (2p - 1)/sqrt(2 p (1 - p)); the means have variance 4.
  const double half_width = 0.95 / std::sqrt(2.0 * 0.975 * 0.025) * std::sqrt(4.0 / 3.0);
  EXPECT_NEAR(of.mean_interval->lower, 4.0 - half_width, 1e-9);
  EXPECT_NEAR(of.mean_interval->upper, 4.0 + half_width, 1e-9);
  EXPECT_FALSE(of.within_share_interval);
}

TEST(OneWayAnalysis, StatesNothingThatItsGroupsCannotTell) {
  const OneWayAnalysis none = GroupedValues(2).analysis(0.95);
  EXPECT_EQ(none.num_groups, 0U);
  EXPECT_FALSE(none.mean_interval);
  const OneWayAnalysis one = analysis_of({{1.0, 3.0}});
  EXPECT_FALSE(one.mean_interval);
  EXPECT_FALSE(one.between_deviation);
  EXPECT_FALSE(one.within_share);
  EXPECT_DOUBLE_EQ(one.within_mean_square, 2.0);
  const OneWayAnalysis equal = analysis_of({{1.0, 1.0}, {1.0, 1.0}});
  EXPECT_FALSE(equal.within_share);
  std::vector<std::vector<double>> silent;
  for (std::size_t i = 0; i < num_groups_min; ++i) {
    const auto value = static_cast<double>(i);
    silent.push_back({value, value});
  }
  EXPECT_EQ(analysis_of(silent).within_share, 0.0);
  EXPECT_FALSE(analysis_of(silent).within_share_interval);
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

constexpr std::uint64_t num_campaigns = 2000;
// A share of 95 % has a standard error of 0.5 %: four of them.
constexpr double lowest = 0.93, highest = 0.97;

struct Hits {
  std::uint64_t count = 0;
  void add(const std::optional<Interval>& interval, double truth) {
    if (interval && interval->lower <= truth && truth <= interval->upper) ++count;
  }
  [[nodiscard]] double share() const {
    return static_cast<double>(count) / static_cast<double>(num_campaigns);
  }
};

enum class Within : std::uint8_t { normal, heteroscedastic, heavy_tailed };

/// Values of a group about its centre, with the variance 1 in the mean over all groups.
std::vector<double> noise_of(Within law, std::size_t size, Uniforms& random) {
  // The logarithm of σ is normal, and σ scatters by 45 %.
  const double log_variance = std::log(1.0 + 0.45 * 0.45);
  const double sigma = law == Within::heteroscedastic
                           ? std::exp(std::sqrt(log_variance) * random.deviate() - log_variance)
                           : 1.0;
  std::vector<double> values(size);
  for (double& value : values) {
    value = sigma * random.deviate();
    if (law == Within::heavy_tailed) value *= random.deviate();  // Has the kurtosis 9.
  }
  return values;
}

/// Coverage of the mean and of the share of the variance within, for groups of four.
std::pair<Hits, Hits> coverage_of(Within law, std::size_t num_groups, double between) {
  std::pair<Hits, Hits> coverage;
  for (std::uint64_t i = 0; i < num_campaigns; ++i) {
    Uniforms random(i);
    GroupedValues values(4);
    for (std::size_t group = 0; group < num_groups; ++group) {
      const double centre = 5.0 + between * random.deviate();
      std::vector<double> of_group = noise_of(law, 4, random);
      for (double& value : of_group) value += centre;
      values.add(of_group);
    }
    const OneWayAnalysis analysis = values.analysis(0.95);
    coverage.first.add(analysis.mean_interval, 5.0);
    coverage.second.add(analysis.within_share_interval, 1.0 / (1.0 + between * between));
  }
  return coverage;
}

TEST(OneWayAnalysis, CoversKnownSharesWhateverTheLawWithin) {
  for (const Within law : {Within::normal, Within::heteroscedastic, Within::heavy_tailed}) {
    for (const std::size_t num_groups : {num_groups_min, std::size_t{120}}) {
      for (const double between : {0.0, 0.5, 1.0, 2.0}) {
        const auto [of_mean, of_share] = coverage_of(law, num_groups, between);
        SCOPED_TRACE(testing::Message() << "law " << static_cast<int>(law) << ", " << num_groups
                                        << " groups, between " << between);
        EXPECT_GE(of_mean.share(), lowest);
        EXPECT_LE(of_mean.share(), highest);
        EXPECT_GE(of_share.share(), lowest);
        // Near the end of the range of shares, an upper limit cannot be too low.
        EXPECT_LE(of_share.share(), between < 1.0 ? 0.99 : highest);
      }
    }
  }
}

// Leaving out several groups at a time estimates the same variance.
TEST(OneWayAnalysis, HasTheSameIntervalFromBlocksOfGroups) {
  constexpr double between = 0.7;
  double sum = 0.0;
  const auto width_of = [&](std::size_t num_groups) {
    Uniforms random(num_groups);
    GroupedValues values(3);
    for (std::size_t group = 0; group < num_groups; ++group) {
      const double centre = 1e3 + between * random.deviate();
      std::vector<double> of_group = noise_of(Within::normal, 3, random);
      for (double& value : of_group) value += centre;
      values.add(of_group);
    }
    const Interval interval = values.analysis(0.95).within_share_interval.value();
    sum += 0.5 * (interval.lower + interval.upper);
    return interval.upper - interval.lower;
  };
  // 1,000 blocks of one and 1,000 of eight: the width has a relative standard error of 2 %.
  EXPECT_NEAR(width_of(1000) / width_of(8000), std::sqrt(8.0), 5.0 * 0.03 * std::sqrt(8.0));
  EXPECT_NEAR(sum / 2.0, 1.0 / (1.0 + between * between), 0.03);
}

/// Quantiles of a beta law with the mean `probability`, whose draws correlate the members of a
/// group by `correlation`.
std::vector<double> group_probabilities(double probability, double correlation) {
  if (correlation == 0.0) return {probability};
  if (correlation == 1.0) {
    std::vector<double> none_or_all(1000, 0.0);
    std::fill_n(none_or_all.begin(), std::lround(1000.0 * probability), 1.0);
    return none_or_all;
  }
  const double sum = 1.0 / correlation - 1.0;
  std::vector<double> quantiles(4000);
  for (std::size_t i = 0; i < quantiles.size(); ++i) {
    const double level = (static_cast<double>(i) + 0.5) / static_cast<double>(quantiles.size());
    quantiles[i] = beta_quantile(level, sum * probability, sum * (1.0 - probability));
  }
  return quantiles;
}

double hit_coverage(std::size_t num_groups, std::uint64_t size, double probability,
                    double correlation) {
  const std::vector<double> probabilities = group_probabilities(probability, correlation);
  const double truth = compensated_sum(probabilities) / static_cast<double>(probabilities.size());
  Hits coverage;
  for (std::uint64_t i = 0; i < num_campaigns; ++i) {
    Uniforms random(i);
    GroupedHits hits(size);
    for (std::size_t group = 0; group < num_groups; ++group) {
      const auto drawn =
          static_cast<std::size_t>(random.next() * static_cast<double>(probabilities.size()));
      std::uint64_t num_hits = 0;
      for (std::uint64_t k = 0; k < size; ++k) {
        if (random.next() < probabilities[drawn]) ++num_hits;
      }
      hits.add(num_hits);
    }
    coverage.add(hits.interval(0.95), truth);
  }
  return coverage.share();
}

// Clopper-Pearson is conservative where hits are few.
TEST(GroupedHits, CoverWhatDependsOnItsGroup) {
  for (const std::uint64_t size : {4U, 16U, 50U}) {
    for (const double probability : {0.001, 0.01, 0.1}) {
      for (const double correlation : {0.0, 0.1, 0.3, 0.6, 1.0}) {
        EXPECT_GE(hit_coverage(80, size, probability, correlation), lowest)
            << size << " members, probability " << probability << ", correlation " << correlation;
      }
    }
  }
}

// 0 of 20 groups say no more than 20 independent runs, and one group no more than one.
TEST(GroupedHits, CountGroupsWhereNothingTellsTheirMembersApart) {
  GroupedHits none(50), one(50);
  for (int i = 0; i < 20; ++i) none.add(0);
  EXPECT_EQ(none.share(), 0.0);
  EXPECT_EQ(none.interval(0.95).lower, 0.0);
  EXPECT_NEAR(none.interval(0.95).upper, 1.0 - std::pow(0.025, 1.0 / 20.0), 1e-9);
  GroupedHits rare(50);
  for (const std::uint64_t hits : {0U, 1U, 0U}) rare.add(hits);
  EXPECT_EQ(rare.interval(0.95).lower, 0.0);
  EXPECT_GT(rare.interval(0.95).upper, 1.0 - std::pow(0.025, 1.0 / 3.0));
  one.add(50);
  EXPECT_EQ(one.share(), 1.0);
  EXPECT_NEAR(one.interval(0.95).lower, 0.025, 1e-9);
}

// Members that are independent are worth nearly their number.
TEST(GroupedHits, CountMembersThatDoNotDependOnTheirGroup) {
  Uniforms random(0);
  GroupedHits hits(10);
  for (int group = 0; group < 1000; ++group) {
    std::uint64_t num_hits = 0;
    for (int k = 0; k < 10; ++k) num_hits += random.next() < 0.5 ? 1U : 0U;
    hits.add(num_hits);
  }
  const Interval interval = hits.interval(0.95);
  // 10,000 of them; the variance between groups has a relative standard error of 4.5 %.
  EXPECT_NEAR(interval.upper - interval.lower, 2.0 * 1.96 * 0.005, 0.15 * 2.0 * 1.96 * 0.005);
}

}  // namespace
}  // namespace proofmass
