#include "core/statistics/requirement.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <ranges>
#include <vector>

#include "core/error.hpp"
#include "core/runs.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/detail/phrase.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// How many of [first, end) hold, which stand in front of those that do not.
template <typename Holds>
std::uint64_t num_in_front(std::uint64_t first, std::uint64_t end, const Holds& holds) {
  const auto numbers = std::views::iota(first, end);
  return static_cast<std::uint64_t>(std::ranges::partition_point(numbers, holds) - numbers.begin());
}

// With probability P(Bin(n, coverage) ≤ n − order) at least `order` values lie above the
// percentile, so that the value of this order is a bound.
bool is_bound(const Tolerance& tolerance, std::uint64_t num_runs, std::uint64_t order) {
  const double doubt = binomial_at_most(static_cast<double>(order) - 1.0,
                                        static_cast<double>(num_runs), 1.0 - tolerance.coverage);
  return order <= num_runs && tolerance.is_shown(doubt);
}

}  // namespace

void Tolerance::validate() const {
  detail::check_fraction("coverage", coverage);
  detail::check_fraction("confidence", confidence);
}

std::uint64_t wilks_order(const Tolerance& tolerance, std::uint64_t num_runs) {
  tolerance.validate();
  const auto holds = [&](std::uint64_t order) { return is_bound(tolerance, num_runs, order); };
  return num_in_front(1, num_runs + 1, holds);
}

std::optional<double> wilks_upper(std::span<const double> values, const Tolerance& tolerance,
                                  std::uint64_t num_unknown) {
  const std::uint64_t order = wilks_order(tolerance, values.size() + num_unknown);
  detail::check_values("values", values, 0);
  if (order <= num_unknown) return std::nullopt;
  std::vector<double> descending(values.begin(), values.end());
  const auto place = descending.begin() + static_cast<std::ptrdiff_t>(order - num_unknown - 1);
  std::nth_element(descending.begin(), place, descending.end(), std::greater<>());
  return *place;
}

namespace {

// Bisections of an interval in [0, 1]: it ends below the spacing of doubles near 1e-3.
constexpr int num_bisections = 64;

/// tail·factor/power. A power of 0 is below the range of doubles: the hits are far from their
/// expectation, on the side where the tail is 1 or on the one where it is 0.
double ratio(double tail, double factor, double power) {
  if (tail <= 0.0) return 0.0;
  if (power <= 0.0) return tail > 0.5 ? std::numeric_limits<double>::infinity() : 0.0;
  return tail * factor / power;
}

}  // namespace

double evidence_of_less(double num_hits, double num_runs, double probability) {
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs);
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  const double a = num_hits + 0.5;
  const double b = num_runs - num_hits + 1.0;
  return ratio(beta_at_most(probability, a, b), 0.5 * (1.0 - probability),
               beta_power(probability, a, b));
}

double evidence_of_more(double num_hits, double num_runs, double probability) {
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs);
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  if (num_hits < 1.0) return 0.0;
  const double a = num_hits - 0.5;
  const double b = num_runs - num_hits + 1.0;
  // (1 − p)/(1 − √p) = 1 + √p.
  return ratio(beta_above(probability, a, b), 0.5 * (1.0 + std::sqrt(probability)),
               beta_power(probability, a, b));
}

Interval sequential_bounds(double num_hits, double num_runs, double confidence) {
  detail::check_fraction("confidence", confidence);
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs && num_runs > 0.0);
  const double enough = 1.0 / (1.0 - confidence);
  const double rate = num_hits / num_runs;
  double excluded_low = 0.0;
  double excluded_high = 1.0;
  double lower = rate;
  double upper = rate;
  // The evidence grows with the distance from the rate, on either side.
  for (int i = 0; i < num_bisections; ++i) {
    const double high = 0.5 * (upper + excluded_high);
    const double low = 0.5 * (lower + excluded_low);
    const bool is_high = high < 1.0 && evidence_of_less(num_hits, num_runs, high) >= enough;
    const bool is_low = low > 0.0 && evidence_of_more(num_hits, num_runs, low) >= enough;
    (is_high ? excluded_high : upper) = high;
    (is_low ? excluded_low : lower) = low;
  }
  return {.lower = excluded_low, .upper = excluded_high, .confidence = confidence};
}

namespace {

/// The verdicts of decide() about one tolerance.
class VerdictRule {
 public:
  VerdictRule(const Tolerance& tolerance, std::optional<std::uint64_t> num_fixed)
      : tolerance_(tolerance), allowed_rate_(1.0 - tolerance.coverage), num_fixed_(num_fixed) {
    tolerance.validate();
    met_confidence_ = not_met_confidence_ = tolerance.confidence;
    if (!num_fixed || *num_fixed == 0) return;
    const auto n = static_cast<double>(*num_fixed);
    const std::uint64_t order = wilks_order(tolerance, *num_fixed);
    if (order > 0) {
      met_confidence_ += binomial_at_most(static_cast<double>(order - 1), n, allowed_rate_);
    }
    const std::uint64_t first_not_met = num_in_front(0, *num_fixed + 1, [&](double k) {
      return !tolerance.is_shown(binomial_at_least(k, n, allowed_rate_));
    });
    if (first_not_met <= *num_fixed) {
      not_met_confidence_ +=
          binomial_at_least(static_cast<double>(first_not_met), n, allowed_rate_);
    }
  }

  [[nodiscard]] bool is_fixed(std::uint64_t num_runs) const { return num_fixed_ == num_runs; }

  [[nodiscard]] Decision decide(double num_exceedances, std::uint64_t num_runs) const {
    if (num_runs == 0) return {};
    const auto n = static_cast<double>(num_runs);
    Decision decision;
    decision.is_of_fixed_size = is_fixed(num_runs);
    decision.verdict = verdict(num_exceedances, num_runs);
    decision.exceedance = decision.is_of_fixed_size
                              ? probability_bounds(num_exceedances, n, tolerance_.confidence)
                              : Interval{.lower = lower_bound(num_exceedances, n),
                                         .upper = upper_bound(num_exceedances, n),
                                         .confidence = tolerance_.confidence};
    return decision;
  }

  [[nodiscard]] RequirementVerdict verdict(double num_exceedances, std::uint64_t num_runs) const {
    if (is_fixed(num_runs)) return fixed_verdict(num_exceedances, static_cast<double>(num_runs));
    if (shows_less(num_exceedances, num_runs)) return RequirementVerdict::met;
    return shows_more(num_exceedances, num_runs) ? RequirementVerdict::not_met
                                                 : RequirementVerdict::undecided;
  }

  /// One more than the exceedances with which so many runs meet it; 0 if none do.
  [[nodiscard]] std::uint64_t bound_order(std::uint64_t num_runs) const {
    if (is_fixed(num_runs)) return wilks_order(tolerance_, num_runs);
    return num_in_front(0, num_runs + 1, [&](double k) { return shows_less(k, num_runs); });
  }

  /// The fewest runs that meet it with so many exceedances among them.
  [[nodiscard]] std::optional<std::uint64_t> runs_to_meet(const ExceedanceCount& count) const {
    const auto k = static_cast<double>(count.num_exceedances);
    const std::optional<std::uint64_t> sequential = sequential_runs_to_meet(k, count);
    const bool is_met_at_fixed =
        num_fixed_ && *num_fixed_ > count.num_runs &&
        fixed_verdict(k, static_cast<double>(*num_fixed_)) == RequirementVerdict::met;
    if (!is_met_at_fixed || (sequential && *sequential < *num_fixed_)) return sequential;
    return num_fixed_;
  }

 private:
  [[nodiscard]] std::optional<std::uint64_t> sequential_runs_to_meet(
      double k, const ExceedanceCount& count) const {
    std::uint64_t too_few = count.num_runs;
    std::uint64_t enough = count.num_runs;
    do {
      too_few = enough;
      enough = std::min(std::max(2 * enough, std::uint64_t{1}), num_runs_max);
      if (enough == too_few) return std::nullopt;
    } while (!shows_less(k, enough));
    const auto is_short = [&](std::uint64_t num_runs) { return !shows_less(k, num_runs); };
    return too_few + 1 + num_in_front(too_few + 1, enough, is_short);
  }

  [[nodiscard]] RequirementVerdict fixed_verdict(double k, double n) const {
    if (tolerance_.is_shown(binomial_at_most(k, n, allowed_rate_))) return RequirementVerdict::met;
    if (tolerance_.is_shown(binomial_at_least(k, n, allowed_rate_)))
      return RequirementVerdict::not_met;
    return RequirementVerdict::undecided;
  }

  [[nodiscard]] bool shows_less(double k, std::uint64_t num_runs) const {
    const auto n = static_cast<double>(num_runs);
    return met_confidence_ < 1.0 && k <= n && num_runs > 0 &&
           evidence_of_less(k, n, allowed_rate_) * (1.0 - met_confidence_) >= 1.0;
  }

  [[nodiscard]] bool shows_more(double k, std::uint64_t num_runs) const {
    return not_met_confidence_ < 1.0 && num_runs > 0 &&
           evidence_of_more(k, static_cast<double>(num_runs), allowed_rate_) *
                   (1.0 - not_met_confidence_) >=
               1.0;
  }

  [[nodiscard]] double upper_bound(double k, double n) const {
    return met_confidence_ < 1.0 ? sequential_bounds(k, n, met_confidence_).upper : 1.0;
  }
  [[nodiscard]] double lower_bound(double k, double n) const {
    return not_met_confidence_ < 1.0 ? sequential_bounds(k, n, not_met_confidence_).lower : 0.0;
  }

  Tolerance tolerance_;
  double allowed_rate_;
  std::optional<std::uint64_t> num_fixed_;
  double met_confidence_ = 0.0;      ///< Of sequential looks; 1 if nothing is left for them.
  double not_met_confidence_ = 0.0;  ///< Of sequential looks; 1 if nothing is left for them.
};

/// The runs that it takes for so many exceedances if they come as often as in those of `check`.
std::uint64_t runs_with(std::uint64_t num_exceedances, const RequirementCheck& check) {
  return (num_exceedances * check.num_runs + check.num_exceedances - 1) / check.num_exceedances;
}

/// Runs that decide, looked for where an exceedance has just come: counts are whole, and there they
/// keep the rate best. By one exceedance fewer may do, where runs_with() rounds.
std::optional<std::uint64_t> runs_to_decide(const VerdictRule& rule,
                                            const RequirementCheck& check) {
  const auto decides = [&](std::uint64_t num_exceedances) {
    return rule.verdict(static_cast<double>(num_exceedances), runs_with(num_exceedances, check)) !=
           RequirementVerdict::undecided;
  };
  std::uint64_t too_few = check.num_exceedances;
  std::uint64_t enough = check.num_exceedances;
  do {
    too_few = enough;
    enough *= 2;
    if (runs_with(too_few + 1, check) > num_runs_max) return std::nullopt;
  } while (!decides(enough));
  enough = too_few + 1 + num_in_front(too_few + 1, enough, std::not_fn(decides));
  const std::uint64_t num_runs = runs_with(enough, check);
  return num_runs <= num_runs_max ? std::optional(num_runs) : std::nullopt;
}

}  // namespace

Requirement parse_requirement(std::string_view text, std::span<const std::string_view> parameters) {
  detail::Phrase phrase(
      "requirement", text,
      "PARAMETER < LIMIT (or <=) for COVERAGE% with CONFIDENCE%\" or \"all objectives "
      "for COVERAGE% with CONFIDENCE%",
      parameters);
  const Requirement requirement = detail::read_requirement(phrase);
  phrase.expect_end();
  return requirement;
}

Requirement detail::read_requirement(Phrase& phrase) {
  Requirement requirement;
  if (phrase.takes(all_objectives_word)) {
    requirement.subject = Requirement::Subject::all_objectives;
    phrase.expect("objectives");
  } else {
    requirement.parameter = phrase.parameter();
    phrase.expect("<");
    requirement.admits_limit = phrase.takes_sign("=");
    requirement.limit = phrase.positive_number();
  }
  phrase.expect("for");
  requirement.tolerance.coverage = phrase.percentage();
  phrase.expect("with");
  requirement.tolerance.confidence = phrase.percentage();
  return requirement;
}

bool exceeds(const Requirement& requirement, std::span<const double> errors,
             std::span<const double> objectives) {
  if (requirement.subject == Requirement::Subject::parameter) {
    return requirement.is_exceeded_by(std::abs(errors[requirement.parameter]));
  }
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (std::abs(errors[i]) > objectives[i]) return true;
  }
  return false;
}

RequirementCheck check_requirement(const Requirement& requirement, const ExceedanceCount& count,
                                   std::optional<std::uint64_t> num_fixed) {
  PROOFMASS_EXPECT(count.num_exceedances <= count.num_runs);
  const VerdictRule rule(requirement.tolerance, num_fixed);
  RequirementCheck check{rule.decide(static_cast<double>(count.num_exceedances), count.num_runs),
                         count};
  check.bound_order = rule.bound_order(count.num_runs);
  if (check.verdict != RequirementVerdict::undecided) return check;
  check.num_runs_at_best = rule.runs_to_meet(count);
  check.num_runs_at_this_rate =
      check.num_exceedances == 0 ? check.num_runs_at_best : runs_to_decide(rule, check);
  return check;
}

std::optional<std::uint64_t> runs_to_meet(const Tolerance& tolerance, const ExceedanceCount& count,
                                          std::optional<std::uint64_t> num_fixed) {
  return VerdictRule(tolerance, num_fixed).runs_to_meet(count);
}

Decision decide(const Tolerance& tolerance, const ExceedanceCount& count,
                std::optional<std::uint64_t> num_fixed) {
  PROOFMASS_EXPECT(count.num_exceedances <= count.num_runs);
  return VerdictRule(tolerance, num_fixed)
      .decide(static_cast<double>(count.num_exceedances), count.num_runs);
}

}  // namespace proofmass
