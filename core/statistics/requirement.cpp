#include "core/statistics/requirement.hpp"

#include <algorithm>

#include "core/campaign/identifiers.hpp"
#include "core/statistics/detail/phrase.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

Verdict verdict(const Tolerance& tolerance, double num_exceedances, double num_runs) {
  const double allowed_rate = 1.0 - tolerance.coverage;
  if (num_runs <= 0.0) return Verdict::undecided;
  if (tolerance.is_shown(binomial_at_most(num_exceedances, num_runs, allowed_rate))) {
    return Verdict::met;
  }
  if (tolerance.is_shown(binomial_at_least(num_exceedances, num_runs, allowed_rate))) {
    return Verdict::not_met;
  }
  return Verdict::undecided;
}

/// The runs that it takes for so many exceedances if they come as often as in those of `check`.
std::uint64_t runs_with(std::uint64_t num_exceedances, const RequirementCheck& check) {
  return (num_exceedances * check.num_runs + check.num_exceedances - 1) / check.num_exceedances;
}

/// Runs that decide, looked for where an exceedance has just come: counts are whole, and there they
/// keep the rate best. By one exceedance fewer may do, where runs_with() rounds.
std::optional<std::uint64_t> runs_to_decide(const Tolerance& tolerance,
                                            const RequirementCheck& check) {
  const auto decides = [&](std::uint64_t num_exceedances) {
    const auto num_runs = static_cast<double>(runs_with(num_exceedances, check));
    return verdict(tolerance, static_cast<double>(num_exceedances), num_runs) != Verdict::undecided;
  };
  std::uint64_t too_few = check.num_exceedances;
  std::uint64_t enough = check.num_exceedances;
  do {
    too_few = enough;
    enough *= 2;
    if (runs_with(too_few + 1, check) > num_runs_max) return std::nullopt;
  } while (!decides(enough));
  while (enough - too_few > 1) {
    const std::uint64_t middle = too_few + (enough - too_few) / 2;
    (decides(middle) ? enough : too_few) = middle;
  }
  const std::uint64_t num_runs = runs_with(enough, check);
  return num_runs <= num_runs_max ? std::optional(num_runs) : std::nullopt;
}

void add_runs_needed(const Tolerance& tolerance, RequirementCheck& check) {
  check.num_runs_at_best = wilks_num_runs(tolerance, check.num_exceedances + 1);
  check.num_runs_at_this_rate =
      check.num_exceedances == 0 ? check.num_runs_at_best : runs_to_decide(tolerance, check);
}

}  // namespace

Requirement parse_requirement(std::string_view text) {
  detail::Phrase phrase("requirement", text, "PARAMETER < LIMIT for COVERAGE% with CONFIDENCE%");
  Requirement requirement;
  requirement.parameter = phrase.parameter();
  phrase.expect("<");
  requirement.limit = phrase.positive_number();
  phrase.expect("for");
  requirement.tolerance.coverage = phrase.percentage();
  phrase.expect("with");
  requirement.tolerance.confidence = phrase.percentage();
  phrase.expect_end();
  return requirement;
}

RequirementCheck check_requirement(const Requirement& requirement, std::span<const double> errors,
                                   std::uint64_t num_without_estimate) {
  const Tolerance& tolerance = requirement.tolerance;
  const auto num_above =
      std::ranges::count_if(errors, [&](double error) { return error >= requirement.limit; });
  RequirementCheck check;
  check.num_runs = errors.size() + num_without_estimate;
  check.num_exceedances = static_cast<std::uint64_t>(num_above) + num_without_estimate;
  check.num_without_estimate = num_without_estimate;
  const std::uint64_t order = wilks_order(tolerance, check.num_runs);
  check.num_allowed = order == 0 ? 0 : order - 1;
  check.bound = wilks_upper(errors, tolerance, num_without_estimate);

  const auto num_exceedances = static_cast<double>(check.num_exceedances);
  const auto num_runs = static_cast<double>(check.num_runs);
  check.verdict = verdict(tolerance, num_exceedances, num_runs);
  if (check.num_runs > 0) {
    check.exceedance = probability_interval(num_exceedances, num_runs, default_confidence);
  }
  if (check.verdict == Verdict::undecided) add_runs_needed(tolerance, check);
  return check;
}

}  // namespace proofmass
