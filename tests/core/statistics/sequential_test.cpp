#include "core/error.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/stop_rule.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

// The integrals of the header, 2 hits in 300 runs (scipy.integrate.quad).
TEST(SequentialEvidence, IsTheAveragedLikelihoodRatio) {
  EXPECT_NEAR(evidence_of_less(2.0, 300.0, 0.02), 3.006495223809, 1e-11);
  EXPECT_NEAR(evidence_of_more(2.0, 300.0, 0.003), 0.83022300305900, 1e-12);
}

// A martingale under the probability that it speaks against: the mean of the next value is the
// present one.
TEST(SequentialEvidence, IsAMartingale) {
  for (const double p : {0.001, 0.01, 0.3, 0.9}) {
    for (const double n : {1.0, 10.0, 500.0}) {
      for (const double k : {1.0, std::floor(0.5 * n), n}) {
        if (k < 1.0) continue;
        const double less = evidence_of_less(k, n, p);
        const double more = evidence_of_more(k, n, p);
        if (less > 1e-200 && less < 1e200) {
          EXPECT_NEAR(((1.0 - p) * evidence_of_less(k, n + 1.0, p) +
                       p * evidence_of_less(k + 1.0, n + 1.0, p)) /
                          less,
                      1.0, 1e-9)
              << k << " of " << n << ", " << p;
        }
        if (more > 1e-200 && more < 1e200) {
          EXPECT_NEAR(((1.0 - p) * evidence_of_more(k, n + 1.0, p) +
                       p * evidence_of_more(k + 1.0, n + 1.0, p)) /
                          more,
                      1.0, 1e-9)
              << k << " of " << n << ", " << p;
        }
      }
    }
  }
}

TEST(SequentialEvidence, SaysNothingWithoutRuns) {
  EXPECT_NEAR(evidence_of_less(0.0, 0.0, 0.01), 1.0, 1e-12);
  EXPECT_EQ(evidence_of_more(0.0, 0.0, 0.01), 0.0);
  EXPECT_EQ(evidence_of_more(0.0, 1e6, 0.01), 0.0);
}

// Far from what is expected, where powers leave the range of a double.
TEST(SequentialEvidence, HoldsForTheLargestCounts) {
  EXPECT_GT(evidence_of_less(0.0, 1e9, 0.5), 1e300);
  EXPECT_EQ(evidence_of_more(0.0, 1e9, 0.5), 0.0);
  EXPECT_GT(evidence_of_more(1e9, 1e9, 0.5), 1e300);
  EXPECT_LT(evidence_of_less(1e9, 1e9, 0.5), 1e-300);
}

// Where the evidence is 20 (scipy.optimize.brentq).
TEST(SequentialBounds, AreWhereTheEvidenceIsEnough) {
  const Interval few = sequential_bounds(3.0, 128.0, 0.95);
  EXPECT_NEAR(few.lower, 0.00230318478240, 1e-11);
  EXPECT_NEAR(few.upper, 0.0820401318759, 1e-11);
  const Interval none = sequential_bounds(0.0, 384.0, 0.95);
  EXPECT_EQ(none.lower, 0.0);
  EXPECT_NEAR(none.upper, 0.00981263823815, 1e-11);
  EXPECT_EQ(sequential_bounds(5.0, 5.0, 0.95).upper, 1.0);
}

TEST(SequentialBounds, RefuseAConfidenceThatIsNone) {
  EXPECT_THROW((void)sequential_bounds(1.0, 2.0, 1.0), InvalidArgument);
}

using Rule = std::function<RequirementVerdict(const ExceedanceCount&)>;

/// What becomes of a campaign that asks a rule at the fixed run counts.
struct Fate {
  double met = 0.0;  ///< Probability.
  double not_met = 0.0;
  double mean_runs = 0.0;  ///< An undecided campaign ends after num_runs_max.
};

double binomial_probability(std::size_t k, std::uint64_t n, double p) {
  const auto runs = static_cast<double>(n);
  const auto hits = static_cast<double>(k);
  const double misses = runs - hits;
  return std::exp(std::lgamma(runs + 1.0) - std::lgamma(hits + 1.0) - std::lgamma(misses + 1.0) +
                  hits * std::log(p) + misses * std::log1p(-p));
}

// Exact: the law of the exceedances among the undecided campaigns, carried from look to look.
Fate fate_of(const Rule& rule, double rate, std::uint64_t num_runs_max) {
  Fate fate;
  std::vector<double> undecided{1.0};  // Probability of k exceedances.
  std::uint64_t num_before = 0;
  for (std::uint64_t n = next_stop_check(0); n <= num_runs_max; n = next_stop_check(n)) {
    const std::uint64_t num_more = n - num_before;
    const double mean = static_cast<double>(num_more) * rate;
    const auto most = static_cast<std::size_t>(
        std::min(static_cast<double>(num_more), mean + 12.0 * std::sqrt(mean) + 12.0));
    std::vector<double> more(most + 1);
    for (std::size_t k = 0; k <= most; ++k) more[k] = binomial_probability(k, num_more, rate);
    std::vector<double> law(undecided.size() + most, 0.0);
    for (std::size_t i = 0; i < undecided.size(); ++i) {
      if (undecided[i] < 1e-18) continue;
      for (std::size_t k = 0; k <= most; ++k) law[i + k] += undecided[i] * more[k];
    }
    for (std::size_t k = 0; k < law.size(); ++k) {
      if (law[k] < 1e-18) continue;
      const RequirementVerdict verdict = rule({.num_runs = n, .num_exceedances = k});
      if (verdict == RequirementVerdict::undecided) continue;
      (verdict == RequirementVerdict::met ? fate.met : fate.not_met) += law[k];
      fate.mean_runs += law[k] * static_cast<double>(n);
      law[k] = 0.0;
    }
    undecided = std::move(law);
    num_before = n;
  }
  for (const double probability : undecided) {
    fate.mean_runs += probability * static_cast<double>(num_before);
  }
  return fate;
}

constexpr Tolerance tolerance_99_95{.coverage = 0.99, .confidence = 0.95};

RequirementVerdict decided(const ExceedanceCount& count) {
  return decide(tolerance_99_95, count, std::nullopt).verdict;
}

RequirementVerdict fixed_count(const ExceedanceCount& count) {
  return decide(tolerance_99_95, count, count.num_runs).verdict;
}

// On the border, where both verdicts are hardest to avoid, each may come with probability 5 %. What
// holds for one look only does not hold for many.
TEST(Decide, KeepsItsErrorRatesOverAllLooks) {
  const Fate sound = fate_of(decided, 0.01, 16384);
  EXPECT_LE(sound.met, 0.05);
  EXPECT_LE(sound.not_met, 0.05);
  EXPECT_GT(sound.met, 0.01);
  EXPECT_GT(sound.not_met, 0.003);
  const Fate unsound = fate_of(fixed_count, 0.01, 16384);
  EXPECT_GT(unsound.met, 0.10);
  EXPECT_GT(unsound.not_met, 0.10);
  RecordProperty("met_percent", std::to_string(100.0 * sound.met));
  RecordProperty("not_met_percent", std::to_string(100.0 * sound.not_met));
  RecordProperty("fixed_met_percent", std::to_string(100.0 * unsound.met));
  RecordProperty("fixed_not_met_percent", std::to_string(100.0 * unsound.not_met));
}

// The rates of README.md in allowed ones.
TEST(Decide, ComesToAnEndWhereThereIsSomethingToTell) {
  struct Case {
    double ratio;
    double mean_runs_max;
  };
  for (const Case& expected : {Case{0.0, 384.0}, Case{0.25, 1200.0}, Case{0.5, 3700.0},
                               Case{2.0, 1700.0}, Case{4.0, 300.0}}) {
    const Fate fate = fate_of(decided, 0.01 * expected.ratio + 1e-12, 16384);
    const double right = expected.ratio < 1.0 ? fate.met : fate.not_met;
    const double wrong = expected.ratio < 1.0 ? fate.not_met : fate.met;
    EXPECT_GT(right, 0.98) << expected.ratio;
    EXPECT_LT(wrong, 0.005) << expected.ratio;
    EXPECT_LE(fate.mean_runs, expected.mean_runs_max + 0.01) << expected.ratio;
  }
}

TEST(Decide, TakesMoreRunsThanACountThatWasFixedBeforehand) {
  EXPECT_EQ(decided({.num_runs = 376}), RequirementVerdict::undecided);
  EXPECT_EQ(decided({.num_runs = 377}), RequirementVerdict::met);
  EXPECT_EQ(fixed_count({.num_runs = 299}), RequirementVerdict::met);
  EXPECT_EQ(decided({}), RequirementVerdict::undecided);
}

TEST(Decide, GivesTheBoundsThatItDecidesBy) {
  const Decision decision = decide(tolerance_99_95, {.num_runs = 384}, std::nullopt);
  EXPECT_EQ(decision.verdict, RequirementVerdict::met);
  EXPECT_NEAR(decision.exceedance->upper, 0.0098126382, 1e-9);
  const Decision other =
      decide(tolerance_99_95, {.num_runs = 128, .num_exceedances = 20}, std::nullopt);
  EXPECT_EQ(other.verdict, RequirementVerdict::not_met);
  EXPECT_NEAR(other.exceedance->lower, 0.0777337667, 1e-9);
}

/// What a report says: met, or how many draws meet it if no further one exceeds.
struct Said {
  bool is_met = false;
  std::uint64_t num_runs_next = 0;
};
using Report = std::function<Said(const ExceedanceCount&)>;

/// Probability of so many exceedances more, as far as it is no less than 1e-12 beyond their mean.
std::vector<double> law_of_more(std::uint64_t num_runs, double rate) {
  std::vector<double> law;
  for (std::uint64_t k = 0; k <= num_runs; ++k) {
    law.push_back(binomial_probability(k, num_runs, rate));
    if (law.back() < 1e-12 && static_cast<double>(k) > static_cast<double>(num_runs) * rate) break;
  }
  return law;
}

/// Probability that a user has ever been told "met" who asks for so many draws at first and then
/// goes on to the number that the report names, again and again: after 0, 1, 2 ... extensions.
/// Exact but for paths that are less probable than 1e-5.
std::vector<double> ever_met(const Report& report, std::uint64_t num_first, int num_extensions,
                             double rate) {
  struct Path {
    double probability = 0.0;
    std::uint64_t num_next = 0;
  };
  std::map<std::pair<std::uint64_t, std::uint64_t>, Path> undecided{{{0, 0}, {1.0, num_first}}};
  std::vector<double> met;
  std::map<std::uint64_t, std::vector<double>> laws;
  for (int look = 0; look <= num_extensions; ++look) {
    std::map<std::pair<std::uint64_t, std::uint64_t>, Path> reached;
    for (const auto& [counts, path] : undecided) {
      std::vector<double>& law = laws[path.num_next - counts.first];
      if (law.empty()) law = law_of_more(path.num_next - counts.first, rate);
      for (std::size_t i = 0; i < law.size(); ++i) {
        reached[{path.num_next, counts.second + i}].probability += path.probability * law[i];
      }
    }
    met.push_back(met.empty() ? 0.0 : met.back());
    undecided.clear();
    for (const auto& [counts, path] : reached) {
      if (path.probability < 1e-5) continue;
      const Said said = report({.num_runs = counts.first, .num_exceedances = counts.second});
      if (said.is_met) met.back() += path.probability;
      if (said.is_met || said.num_runs_next <= counts.first) continue;
      undecided[counts] = {path.probability, said.num_runs_next};
    }
  }
  return met;
}

/// What the program says to a campaign that asked for so many draws before its first result. After
/// the first look the number of runs that meet it depends on the exceedances alone.
Report report_after(std::optional<std::uint64_t> num_fixed) {
  const auto known = std::make_shared<std::map<std::uint64_t, std::uint64_t>>();
  return [num_fixed, known](const ExceedanceCount& count) {
    const auto [entry, is_new] = known->try_emplace(count.num_exceedances);
    if (is_new) {
      const std::uint64_t k = count.num_exceedances;
      const ExceedanceCount before{.num_runs = std::max(num_fixed.value_or(0), k),
                                   .num_exceedances = k};
      entry->second = runs_to_meet(tolerance_99_95, before, num_fixed).value_or(0);
    }
    const bool is_met =
        count.num_runs == num_fixed
            ? decide(tolerance_99_95, count, num_fixed).verdict == RequirementVerdict::met
            : entry->second != 0 && entry->second <= count.num_runs;
    return Said{.is_met = is_met, .num_runs_next = entry->second};
  };
}

// Just as often as allowed, where every "met" is an error, of which 5 % are allowed in all.
TEST(Decide, KeepsTheConsumersRiskOfThoseWhoGoOnAsTheReportSays) {
  for (const std::uint64_t num_first : {100U, 299U}) {
    const std::vector<double> met = ever_met(report_after(num_first), num_first, 30, 0.01);
    EXPECT_LE(met[30], 0.05) << num_first;
    for (const std::size_t i : {0U, 1U, 2U, 30U}) {
      RecordProperty("met_percent_" + std::to_string(num_first) + "_" + std::to_string(i),
                     std::to_string(100.0 * met[i]));
    }
  }
  EXPECT_LE(ever_met(report_after(std::nullopt), 299, 30, 0.01)[30], 0.05);
}

// It is no empty promise: a requirement that holds is met.
TEST(Decide, MeetsARequirementThatHolds) {
  EXPECT_GT(ever_met(report_after(299), 299, 3, 0.001)[3], 0.9);
}

// P(Bin(299, 0.01) = 0) = 4.95 % are spent at the first look: 0.05 % are left, evidence of 2,156.
TEST(Decide, LeavesTheRestOfTheRiskToThoseWhoGoOn) {
  const auto verdict_at = [](std::uint64_t num_runs) {
    return decide(tolerance_99_95, {.num_runs = num_runs}, 299).verdict;
  };
  EXPECT_TRUE(decide(tolerance_99_95, {.num_runs = 299}, 299).is_of_fixed_size);
  EXPECT_EQ(verdict_at(299), RequirementVerdict::met);
  EXPECT_EQ(verdict_at(300), RequirementVerdict::undecided);
  const std::uint64_t next = *runs_to_meet(tolerance_99_95, {.num_runs = 300}, 299);
  EXPECT_EQ(verdict_at(next - 1), RequirementVerdict::undecided);
  EXPECT_EQ(verdict_at(next), RequirementVerdict::met);
  EXPECT_GT(evidence_of_less(0.0, static_cast<double>(next), 0.01),
            1.0 / (0.05 - std::pow(0.99, 299.0)));
}

}  // namespace
}  // namespace proofmass
