#include "core/statistics/requirement.hpp"

#include <algorithm>
#include <cmath>

#include "core/error.hpp"
#include "core/runs.hpp"
#include "core/statistics/detail/phrase.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/sequential.hpp"

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

Requirement parse_requirement(std::string_view text, std::span<const std::string_view> parameters) {
  detail::Phrase phrase("requirement", text,
                        "PARAMETER < LIMIT for COVERAGE% with CONFIDENCE%\" or \"all objectives "
                        "for COVERAGE% with CONFIDENCE%",
                        parameters);
  const Requirement requirement = detail::read_requirement(phrase);
  phrase.expect_end();
  return requirement;
}

Requirement detail::read_requirement(Phrase& phrase) {
  Requirement requirement;
  if (phrase.takes("all")) {
    requirement.subject = Requirement::Subject::all_objectives;
    phrase.expect("objectives");
  } else {
    requirement.parameter = phrase.parameter();
    phrase.expect("<");
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
    return std::abs(errors[requirement.parameter]) >= requirement.limit;
  }
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (std::abs(errors[i]) > objectives[i]) return true;
  }
  return false;
}

RequirementCheck check_requirement(const Requirement& requirement, std::span<const double> errors,
                                   std::uint64_t num_without_estimate) {
  PROOFMASS_EXPECT(requirement.subject == Requirement::Subject::parameter);
  const auto num_above =
      std::ranges::count_if(errors, [&](double error) { return error >= requirement.limit; });
  RequirementCheck check = check_requirement(
      requirement, {.num_runs = errors.size() + num_without_estimate,
                    .num_exceedances = static_cast<std::uint64_t>(num_above) + num_without_estimate,
                    .num_without_estimate = num_without_estimate});
  check.bound = wilks_upper(errors, requirement.tolerance, num_without_estimate);
  return check;
}

RequirementCheck check_requirement(const Requirement& requirement, const ExceedanceCount& count) {
  PROOFMASS_EXPECT(count.num_exceedances <= count.num_runs);
  const Tolerance& tolerance = requirement.tolerance;
  tolerance.validate();
  RequirementCheck check;
  check.num_runs = count.num_runs;
  check.num_exceedances = count.num_exceedances;
  check.num_without_estimate = count.num_without_estimate;
  const std::uint64_t order = wilks_order(tolerance, check.num_runs);
  check.num_allowed = order == 0 ? 0 : order - 1;

  const auto num_exceedances = static_cast<double>(check.num_exceedances);
  const auto num_runs = static_cast<double>(check.num_runs);
  check.verdict = verdict(tolerance, num_exceedances, num_runs);
  if (check.num_runs > 0) {
    check.exceedance = probability_bounds(num_exceedances, num_runs, tolerance.confidence);
  }
  if (check.verdict == Verdict::undecided) add_runs_needed(tolerance, check);
  return check;
}

Decision decide(const Tolerance& tolerance, const ExceedanceCount& count) {
  PROOFMASS_EXPECT(count.num_exceedances <= count.num_runs);
  tolerance.validate();
  if (count.num_runs == 0) return {};
  const auto num_exceedances = static_cast<double>(count.num_exceedances);
  const auto num_runs = static_cast<double>(count.num_runs);
  Decision decision;
  decision.exceedance = sequential_bounds(num_exceedances, num_runs, tolerance.confidence);
  const double allowed_rate = 1.0 - tolerance.coverage;
  if (decision.exceedance->upper <= allowed_rate) decision.verdict = Verdict::met;
  if (decision.exceedance->lower >= allowed_rate) decision.verdict = Verdict::not_met;
  return decision;
}

}  // namespace proofmass
