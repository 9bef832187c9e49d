#include "core/campaign/field.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(Range, ContainsItsClosedEndsAndNothingThatIsNotFinite) {
  EXPECT_TRUE(range::between(1.0, 2.0).contains(1.0));
  EXPECT_TRUE(range::between(1.0, 2.0).contains(2.0));
  EXPECT_FALSE(range::between(1.0, 2.0).contains(std::nextafter(2.0, 3.0)));
  EXPECT_FALSE(range::between(1.0, 2.0).contains(std::nextafter(1.0, 0.0)));
  EXPECT_FALSE(range::positive.contains(0.0));
  EXPECT_TRUE(range::positive.contains(std::numeric_limits<double>::denorm_min()));
  EXPECT_TRUE(range::not_negative.contains(0.0));
  for (const double value : {infinity, -infinity, std::nan("")}) {
    EXPECT_FALSE(range::any.contains(value));
  }
}

TEST(Range, SaysItsRuleForPeople) {
  EXPECT_EQ(range::any.rule(), "must be finite");
  EXPECT_EQ(range::positive.rule(), "must be > 0");
  EXPECT_EQ(range::not_negative.rule(), "must be >= 0");
  EXPECT_EQ(range::between(0.1, 2.0).rule(), "must be in [0.1, 2]");
  EXPECT_EQ((Range{0.0, 1.0, true}.rule()), "must be in (0, 1]");
  EXPECT_EQ((Range{.maximum = 3.0}.rule()), "must be <= 3");
}

constexpr std::uint32_t draws_max = 1000;
constexpr std::int64_t rounds_max = 10;

/// The first rule that such a result breaks.
std::string broken(RunStatus status, std::uint32_t num_draws, std::uint32_t num_rounds) {
  const RunResult result{
      .run = {0}, .status = status, .num_draws = num_draws, .num_rounds = num_rounds};
  const std::vector<std::string> rules = broken_count_rules(result, draws_max, rounds_max);
  return rules.empty() ? "" : rules.front();
}

Quantity quantity_of(std::string name, bool has_standard_error = false) {
  Quantity quantity;
  quantity.name = std::move(name);
  quantity.has_standard_error = has_standard_error;
  return quantity;
}

HealthQuantity health_of(std::string name) {
  HealthQuantity quantity;
  quantity.name = std::move(name);
  return quantity;
}

/// The first rule about sizes that a result of two quantities, one with a standard error, breaks.
std::string broken_size(const std::function<void(RunResult&)>& change) {
  const ResultSchema schema{.quantities = {quantity_of("gain", true), quantity_of("offset")},
                            .health = {health_of("peak")},
                            .loss_causes = {"saturation"},
                            .loss_sessions = {"first", "second"},
                            .fit = {health_of("chi_squared")}};
  RunResult result{.run = {0},
                   .truth = {1.0, 2.0},
                   .estimate = {1.5, 2.5},
                   .standard_error = {0.5},
                   .fit = {3.0},
                   .health = {4.0}};
  change(result);
  const std::vector<std::string> rules = broken_size_rules(result, schema);
  return rules.empty() ? "" : rules.front();
}

TEST(RunResult, HasListsAsLongAsItsStatusAndTheSchemaMakeThem) {
  EXPECT_EQ(broken_size([](RunResult&) {}), "");
  EXPECT_EQ(broken_size([](RunResult& result) { result.truth.pop_back(); }),
            "truth = 1 entries (must be 2 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.estimate.push_back(0.0); }),
            "estimate = 3 entries (must be 2 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.standard_error.push_back(1.0); }),
            "standard_error = 2 entries (must be 1 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.fit.clear(); }),
            "fit = 0 entries (must be 1 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.correlations = {0.5}; }),
            "correlation = 1 entries (must be 0 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.health.push_back(1.0); }),
            "health = 2 entries (must be 1 if completed)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.status = RunStatus::not_finite; }),
            "estimate = 2 entries (must be 0 if not_finite)");
}

TEST(RunResult, HasALossThatTheSchemaNamesIfItIsLost) {
  const auto lose = [](std::uint32_t cause, std::uint32_t session) {
    return broken_size([=](RunResult& result) {
      result = {.run = {0}, .status = RunStatus::lost, .truth = {1.0, 2.0}};
      result.loss = {.cause = cause, .session = session};
    });
  };
  EXPECT_EQ(lose(1, 2), "");
  EXPECT_EQ(lose(0, 1), "loss_cause = 0 (must be in [1, 1] if lost)");
  EXPECT_EQ(lose(1, 3), "loss_session = 3 (must be in [1, 2] if lost)");
  EXPECT_EQ(broken_size([](RunResult& result) { result.loss.cause = 1; }),
            "loss_cause = 1 (must be in [0, 0] if completed)");
}

// What draw_instrument() and estimate_hardy2013() can count.
TEST(RunResult, HasTheCountsThatItsStatusAllows) {
  EXPECT_EQ(broken(RunStatus::completed, 1, 3), "");
  EXPECT_EQ(broken(RunStatus::completed, 1000, 10), "");
  EXPECT_EQ(broken(RunStatus::not_converged, 1, 10), "");
  EXPECT_EQ(broken(RunStatus::not_finite, 2, 0), "");
  EXPECT_EQ(broken(RunStatus::no_draw, 1000, 0), "");
  EXPECT_EQ(broken(RunStatus::completed, 0, 3), "num_draws = 0 (must be 1 to 1000 if completed)");
  EXPECT_EQ(broken(RunStatus::completed, 4294967295, 3),
            "num_draws = 4294967295 (must be 1 to 1000 if completed)");
  EXPECT_EQ(broken(RunStatus::completed, 1, 11), "num_rounds = 11 (must be 0 to 10 if completed)");
  EXPECT_EQ(broken(RunStatus::not_converged, 1, 9),
            "num_rounds = 9 (must be 10 to 10 if not_converged)");
  EXPECT_EQ(broken(RunStatus::no_draw, 999, 0),
            "num_draws = 999 (must be 1000 to 1000 if no_draw)");
  EXPECT_EQ(broken(RunStatus::no_draw, 1000, 1), "num_rounds = 1 (must be 0 to 0 if no_draw)");
  EXPECT_EQ(broken_count_rules(
                {.run = {0}, .status = RunStatus::no_draw, .num_draws = 7, .num_rounds = 5},
                draws_max, rounds_max)
                .size(),
            2U);
}

TEST(RunRanges, AreTheFewestThatHoldTheRuns) {
  const std::vector<RunIndex> runs{{0}, {1}, {2}, {5}, {9}, {10}};
  const std::vector<RunRange> ranges{{{0}, 3}, {{5}, 1}, {{9}, 2}};
  EXPECT_EQ(ranges_of(runs), ranges);
  EXPECT_EQ(indices_of(ranges), runs);
  EXPECT_TRUE(ranges_of(std::vector<RunIndex>{}).empty());
}

}  // namespace
}  // namespace proofmass
