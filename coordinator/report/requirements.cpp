#include "coordinator/report/requirements.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "coordinator/table/figures.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

std::string percent(double fraction, int num_digits) {
  return fmt::format("{:.{}g}", 100.0 * fraction, num_digits);
}

/// With as many digits, from four on, as it takes not to move onto the limit or across it.
std::string percent_beside(double bound, double limit) {
  constexpr int num_digits_max = 12;
  const double limit_percent = 100.0 * limit;
  const auto is_true_to = [&](double shown) {
    return (shown <= limit_percent) == (bound <= limit) &&
           (shown >= limit_percent) == (bound >= limit);
  };
  int num_digits = 4;
  while (num_digits < num_digits_max && !is_true_to(std::stod(percent(bound, num_digits)))) {
    ++num_digits;
  }
  return percent(bound, num_digits) + " %";
}

/// Three digits of the fraction, and of what lacks to 1 if that is less.
std::string short_percent(double fraction) {
  if (fraction <= 0.0 || fraction >= 1.0) return percent(fraction, 3);
  int num_digits = 3;
  while (num_digits < 12 && std::stod(percent(fraction, num_digits)) >= 100.0) ++num_digits;
  return percent(fraction, num_digits);
}

constexpr std::size_t margin = 13;

std::string missing_lines(const RequirementAnswer& answer) {
  const std::uint64_t num_missing = answer.check.num_without_estimate;
  if (num_missing == 0) return "";
  return fmt::format("{0:{1}}{2} of them for want of an estimate:\n{0:{1}}{3}\n", "", margin,
                     num_missing, reasons_text(answer.missing));
}

/// How many runs exceed the limit, and the bound that decides.
std::string exceedance_lines(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const double allowed = 1.0 - answer.requirement.tolerance.coverage;
  const std::string counts =
      fmt::format("Exceeding    {} of {} runs", check.num_exceedances, check.num_runs);
  std::string text = counts + "\n";
  if (check.exceedance) {
    text = line_of(counts + ";", bounds_text(*check.exceedance, allowed, check.verdict), margin);
  }
  return text + fmt::format("Allowed      {} of all draws\n", given_percent(allowed)) +
         missing_lines(answer);
}

/// The lines about the runs in which all objectives hold.
std::string holding_lines(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const double required = answer.requirement.tolerance.coverage;
  const std::string counts = fmt::format("Holding      {} of {} runs",
                                         check.num_runs - check.num_exceedances, check.num_runs);
  std::string text = counts + "\n";
  if (check.exceedance) {
    const Interval bounds{.lower = 1.0 - check.exceedance->upper,
                          .upper = 1.0 - check.exceedance->lower,
                          .confidence = check.exceedance->confidence};
    text = line_of(counts + ";", success_text(bounds, required, check.verdict), margin);
  }
  return text + fmt::format("Required     {} of all draws\n", given_percent(required)) +
         missing_lines(answer);
}

std::string bound_line(const RequirementAnswer& answer) {
  const Tolerance& tolerance = answer.requirement.tolerance;
  if (answer.is_joint()) return "";
  if (!answer.bound) {
    return fmt::format(
        "Bound        none of {}, for {} with {}\n",
        answer.check.num_without_estimate == 0
            ? std::string("so few draws")
            : fmt::format("draws of which {} have no estimate", answer.check.num_without_estimate),
        given_percent(tolerance.coverage), given_percent(tolerance.confidence));
  }
  const Quantity& quantity = answer.subject;
  return fmt::format("Bound        {} of all draws below {:.6g}{}{}, with {}\n",
                     given_percent(tolerance.coverage), *answer.bound,
                     quantity.unit == "1" ? "" : " ", quantity.unit == "1" ? "" : quantity.unit,
                     given_percent(tolerance.confidence));
}

std::string needed_line(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  if (check.verdict != RequirementVerdict::undecided) return "";
  const auto count = [](const std::optional<std::uint64_t>& num_runs) {
    return num_runs ? std::to_string(*num_runs) : "none";
  };
  return fmt::format(
      "Draws        {} meet the requirement if no further one exceeds {},\n"
      "             {} decide if they go on to exceed {} as often\n",
      count(check.num_runs_at_best), answer.is_joint() ? "an objective" : "the limit",
      count(check.num_runs_at_this_rate), answer.is_joint() ? "one" : "it");
}

}  // namespace

double required_value(const RunResult& result, std::size_t position,
                      const std::optional<ErrorBudget>& budget) {
  const std::size_t num_quantities = result.estimate.size();
  if (position < num_quantities) return std::abs(result.error(position));
  PROOFMASS_EXPECT(budget.has_value());
  const Budget of_run = budget->of_run(result);
  return position == num_quantities ? of_run.total
                                    : of_run.entries.at(position - num_quantities - 1);
}

void Exceedances::add(const RunResult& result) {
  if (!result.is_completed()) return;
  if (requirement_.subject == Requirement::Subject::parameter) {
    ++num_estimated_;
    const double value = required_value(result, requirement_.parameter, budget_);
    if (value >= requirement_.limit) ++num_exceeding_;
    return;
  }
  std::vector<double> errors(objectives_.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = result.error(i);
  ++num_estimated_;
  if (exceeds(requirement_, errors, objectives_)) ++num_exceeding_;
}

ExceedanceCount Exceedances::of(std::uint64_t num_runs) const {
  if (num_estimated_ > num_runs) {
    throw InvalidArgument(
        fmt::format("runs with an estimate = {} (must be at most {})", num_estimated_, num_runs));
  }
  const std::uint64_t num_without_estimate = num_runs - num_estimated_;
  return {.num_runs = num_runs,
          .num_exceedances = num_exceeding_ + num_without_estimate,
          .num_without_estimate = num_without_estimate};
}

std::optional<double> RequirementAnswer::relative_margin() const {
  if (!limit || !bound) return std::nullopt;
  return 1.0 - *bound / *limit;
}

std::string rule_text(const RequirementAnswer& answer) {
  if (answer.check.is_of_fixed_size) {
    return fmt::format("{} draws, a number fixed before the first result", answer.check.num_runs);
  }
  return "sequential: holds however often one looks and goes on";
}

std::string_view name_of(RequirementVerdict verdict) {
  switch (verdict) {
    case RequirementVerdict::met:
      return "met";
    case RequirementVerdict::not_met:
      return "not met";
    case RequirementVerdict::undecided:
      return "undecided";
  }
  PROOFMASS_EXPECT(false);
}

// Thirteen decimals are those that a double near 1 has.
std::string given_percent(double fraction) {
  std::string percent = fmt::format("{:.13f}", 100.0 * fraction);
  percent.erase(percent.find_last_not_of('0') + 1);
  if (percent.back() == '.') percent.pop_back();
  return percent + " %";
}

std::string interval_percent(const Interval& interval) {
  return fmt::format("{} to {} %", short_percent(interval.lower), short_percent(interval.upper));
}

std::string bounds_text(const Interval& bounds, double limit, RequirementVerdict verdict) {
  const std::string confidence = given_percent(bounds.confidence);
  const std::string lower = percent_beside(bounds.lower, limit);
  const std::string upper = percent_beside(bounds.upper, limit);
  if (verdict == RequirementVerdict::met) {
    return fmt::format("at most {} of all draws, with {}", upper, confidence);
  }
  if (verdict == RequirementVerdict::not_met) {
    return fmt::format("at least {} of all draws, with {}", lower, confidence);
  }
  return fmt::format("at least {} and at most {} of all draws, each with {}", lower, upper,
                     confidence);
}

std::string success_text(const Interval& bounds, double required, RequirementVerdict verdict) {
  // What is above the requirement meets it: as what is below the limit does, the other way round.
  if (verdict == RequirementVerdict::met)
    return bounds_text(bounds, required, RequirementVerdict::not_met);
  if (verdict == RequirementVerdict::not_met)
    return bounds_text(bounds, required, RequirementVerdict::met);
  return bounds_text(bounds, required, verdict);
}

Tone tone_of(RequirementVerdict verdict) {
  if (verdict == RequirementVerdict::undecided) return Tone::open;
  return verdict == RequirementVerdict::met ? Tone::good : Tone::bad;
}

std::string requirement_text(const RequirementAnswer& answer, Paint paint) {
  return fmt::format("Requirement  {}\nAnswer       {}\nRule         {}\n{}{}{}",
                     wire::visible_text(answer.stated.requirement),
                     in_tone(name_of(answer.check.verdict), tone_of(answer.check.verdict), paint),
                     rule_text(answer),
                     answer.is_joint() ? holding_lines(answer) : exceedance_lines(answer),
                     bound_line(answer), needed_line(answer));
}

}  // namespace proofmass::coordinator
