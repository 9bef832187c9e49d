#include "coordinator/report/requirements.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.hpp"
#include "core/result_rules.hpp"
#include "core/statistics/interval.hpp"
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
  // What count_lines() counts of all objectives are the runs that hold.
  const std::string of = answer.is_joint()
                             ? fmt::format("the {} others", answer.check.num_exceedances)
                             : std::string("them");
  return fmt::format("{0:{1}}{2} of {3} for want of an estimate:\n{0:{1}}{4}\n", "", margin,
                     num_missing, of, reasons_text(answer.missing));
}

/// How many runs exceed the limit, or in how many all objectives hold, and the bound that decides.
std::string count_lines(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const double required = answer.requirement.tolerance.coverage;
  const bool is_joint = answer.is_joint();
  const std::string counts = fmt::format(
      "{}    {} of {} runs", is_joint ? "Holding  " : "Exceeding",
      is_joint ? check.num_runs - check.num_exceedances : check.num_exceedances, check.num_runs);
  std::string text = counts + "\n";
  if (check.exceedance) {
    text = fmt::format("{}; {}\n", counts,
                       bounds_text(answer.requirement, *check.exceedance, check.verdict));
  }
  text += missing_lines(answer);
  if (answer.of_all) text += fmt::format("{:{}}{}\n", "", margin, text_of_all(answer));
  return text + fmt::format("{}     {} of all draws\n", is_joint ? "Required" : "Allowed ",
                            given_percent(is_joint ? required : 1.0 - required));
}

std::string with_unit(double value, std::string_view unit) {
  return unit == "1" ? fmt::format("{:.6g}", value) : fmt::format("{:.6g} {}", value, unit);
}

// Tables may show the quantity in another unit than that of the requirement.
std::string limit_line(const RequirementAnswer& answer) {
  if (answer.is_joint()) return "";
  return fmt::format("Limit        {}\n", with_unit(answer.limit(), answer.subject.unit));
}

/// Of a requirement that a project's document states.
std::string statement_line(const StatedRequirement& stated) {
  if (stated.is_numbered) return "";
  const std::string text = stated.id + (stated.text.empty() ? "" : ": ") + stated.text;
  return fmt::format("{:{}}{}\n", "", margin, wire::visible_text(text));
}

std::string bound_line(const RequirementAnswer& answer) {
  const Tolerance& tolerance = answer.requirement.tolerance;
  if (answer.is_joint() || answer.of_all) return "";
  if (!answer.bound) {
    return fmt::format(
        "Bound        none of {}, for {} with {}\n",
        answer.check.num_without_estimate == 0
            ? std::string("so few draws")
            : fmt::format("draws of which {} have no estimate", answer.check.num_without_estimate),
        given_percent(tolerance.coverage), given_percent(tolerance.confidence));
  }
  return fmt::format(
      "Bound        {} of all draws at most {}, with {}\n", given_percent(tolerance.coverage),
      with_unit(*answer.bound, answer.subject.unit), given_percent(tolerance.confidence));
}

std::string assumption_line(const RequirementAnswer& answer) {
  if (answer.assumption.empty()) return "";
  return fmt::format("Assumed      {}: no session tells it\n", answer.assumption);
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

double Exceedances::value_of(const RunResult& result) const {
  const std::size_t position = requirement_.parameter;
  const std::size_t num_quantities = objectives_.size();
  if (position < num_quantities) return std::abs(result.error(position));
  PROOFMASS_EXPECT(budget_.has_value());
  const Budget of_run = budget_->of_run(result);
  return position == num_quantities ? of_run.total
                                    : of_run.entries.at(position - num_quantities - 1);
}

double largest_ratio(const RunResult& result, std::span<const double> objectives) {
  double largest = 0.0;
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    largest = std::max(largest, std::abs(result.error(i)) / objectives[i]);
  }
  return largest;
}

double Exceedances::add(const RunResult& result) {
  ++num_estimated_;
  if (requirement_.subject == Requirement::Subject::parameter) {
    const double value = value_of(result);
    if (requirement_.is_exceeded_by(value)) ++num_exceeding_;
    return value;
  }
  std::vector<double> errors(objectives_.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = result.error(i);
  if (exceeds(requirement_, errors, objectives_)) ++num_exceeding_;
  return largest_ratio(result, objectives_);
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
  if (!bound) return std::nullopt;
  return 1.0 - *bound / limit();
}

Interval RequirementAnswer::exceedance_of_all() const {
  const ExceedanceCount& all = of_all.value();
  return probability_interval(static_cast<double>(all.num_exceedances),
                              static_cast<double>(all.num_runs), default_confidence);
}

bool RequirementAnswer::is_opposed() const {
  if (!of_all) return false;
  const Interval exceedance = exceedance_of_all();
  const double allowed = 1.0 - requirement.tolerance.coverage;
  return check.verdict == RequirementVerdict::met ? exceedance.lower > allowed
                                                  : exceedance.upper < allowed;
}

std::string rule_text(const RequirementAnswer& answer) {
  if (answer.check.is_of_fixed_size) {
    const std::string later =
        answer.of_all
            ? fmt::format("; {} more since", answer.of_all->num_runs - answer.check.num_runs)
            : std::string();
    return fmt::format("{}, a number fixed before the first result{}",
                       counted(answer.check.num_runs, "draw"), later);
  }
  return "sequential: holds however often one looks and goes on" +
         (answer.num_left_out == 0 ? std::string()
                                   : fmt::format("; left out: {} after the first that is missing",
                                                 counted(answer.num_left_out, "run")));
}

std::string text_of_all(const RequirementAnswer& answer) {
  const ExceedanceCount& all = answer.of_all.value();
  Interval interval = answer.exceedance_of_all();
  if (answer.is_joint()) {
    interval = {.lower = 1.0 - interval.upper,
                .upper = 1.0 - interval.lower,
                .confidence = interval.confidence};
  }
  return fmt::format(
      "{} of all {} runs; {} of all draws, with {}{}",
      answer.is_joint() ? all.num_runs - all.num_exceedances : all.num_exceedances, all.num_runs,
      interval_percent(interval), given_percent(interval.confidence),
      answer.is_opposed() ? ": they speak against this answer, which more runs may change" : "");
}

std::string_view name_of(RequirementVerdict verdict) {
  if (verdict == RequirementVerdict::undecided) return "undecided";
  return verdict == RequirementVerdict::met ? "met" : "not met";
}

// Thirteen decimals are those that a double near 1 has.
std::string given_percent(double fraction) {
  return without_end_zeros(fmt::format("{:.13f}", 100.0 * fraction)) + " %";
}

std::string interval_percent(const Interval& interval) {
  return fmt::format("{} to {} %", short_percent(interval.lower), short_percent(interval.upper));
}

std::string bounds_text(const Requirement& requirement, const Interval& exceedance,
                        RequirementVerdict verdict) {
  const double required = requirement.tolerance.coverage;
  const std::string confidence = given_percent(exceedance.confidence);
  const bool is_joint = requirement.subject == Requirement::Subject::all_objectives;
  const std::string lower = is_joint ? percent_beside(1.0 - exceedance.upper, required)
                                     : percent_beside(exceedance.lower, 1.0 - required);
  const std::string upper = is_joint ? percent_beside(1.0 - exceedance.lower, required)
                                     : percent_beside(exceedance.upper, 1.0 - required);
  if (verdict == RequirementVerdict::undecided) {
    return fmt::format("at least {} and at most {} of all draws, each with {}", lower, upper,
                       confidence);
  }
  // What holds often enough meets a requirement, as what exceeds a limit seldom enough does.
  const bool is_upper = (verdict == RequirementVerdict::met) != is_joint;
  return fmt::format("at {} {} of all draws, with {}", is_upper ? "most" : "least",
                     is_upper ? upper : lower, confidence);
}

Tone tone_of(RequirementVerdict verdict) {
  if (verdict == RequirementVerdict::undecided) return Tone::open;
  return verdict == RequirementVerdict::met ? Tone::good : Tone::bad;
}

std::string requirement_text(const RequirementAnswer& answer, Paint paint) {
  return fitted(
      fmt::format("Requirement  {}\n{}{}Answer       {}\nRule         {}\n{}{}{}{}",
                  wire::visible_text(answer.stated.requirement), statement_line(answer.stated),
                  limit_line(answer),
                  in_tone(name_of(answer.check.verdict), tone_of(answer.check.verdict), paint),
                  rule_text(answer), count_lines(answer), bound_line(answer),
                  assumption_line(answer), needed_line(answer)));
}

namespace {

std::string default_tolerance_text() {
  return fmt::format("for {:.12g}% with {:.12g}%", 100.0 * default_tolerance.coverage,
                     100.0 * default_tolerance.confidence);
}

bool has_finite(std::span<const double> objectives) {
  return std::ranges::any_of(objectives, [](double value) { return std::isfinite(value); });
}

/// A requirement for each objective of the campaign.
std::vector<StatedRequirement> requirements_of_objectives(const ResultSchema& schema,
                                                          std::span<const double> objectives) {
  const std::vector<Quantity>& quantities = schema.quantities;
  std::vector<StatedRequirement> stated;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    if (!std::isfinite(objectives[i])) continue;
    const std::string& name = quantities[i].name;
    stated.push_back(
        {.id = name,
         .text = fmt::format("Objective of {}", quantities[i].symbol),
         // The shortest text that reads back to the same bits.
         .requirement = fmt::format("{} <= {} {}", name, objectives[i], default_tolerance_text()),
         .is_default = true});
  }
  return stated;
}

/// All objectives together, with the default tolerance.
StatedRequirement joint_requirement() {
  return {.id = "all",
          .text = "All objectives together",
          .requirement = "all objectives " + default_tolerance_text(),
          .is_default = true};
}

}  // namespace

std::vector<StatedRequirement> numbered_requirements(std::span<const std::string> requirements) {
  std::vector<StatedRequirement> stated;
  for (const std::string& requirement : requirements) {
    stated.push_back({.id = fmt::format("R{}", stated.size() + 1),
                      .text = "",
                      .requirement = requirement,
                      .is_numbered = true});
  }
  return stated;
}

std::vector<StatedRequirement> matrix_requirements(const ResultSchema& schema,
                                                   std::vector<StatedRequirement> stated,
                                                   std::span<const double> objectives) {
  const auto is_joint = [&](const StatedRequirement& each) {
    return parse_requirement(each.requirement, schema).subject ==
           Requirement::Subject::all_objectives;
  };
  if (stated.empty()) stated = requirements_of_objectives(schema, objectives);
  if (has_finite(objectives) && std::ranges::none_of(stated, is_joint)) {
    stated.push_back(joint_requirement());
  }
  return stated;
}

VerificationMatrix::VerificationMatrix(const ResultSchema& schema,
                                       std::vector<StatedRequirement> stated,
                                       std::span<const double> objectives, const JudgedRuns& judged,
                                       std::optional<std::uint64_t> num_fixed,
                                       const std::optional<ErrorBudget>& budget)
    : judged_(judged),
      num_fixed_(num_fixed),
      budget_(budget),
      missing_{.num_given_up = judged.num_given_up},
      num_runs_(judged.num_given_up) {
  if (budget_) {
    assumed_level_ = fmt::format("{} = {:.3g} {}", budget_->level_label, budget_->assumed_level,
                                 schema.health.at(budget_->level).unit);
  }
  for (StatedRequirement& each : stated) {
    RequirementAnswer answer;
    answer.stated = std::move(each);
    answer.num_left_out = judged_.num_left_out;
    answer.requirement = parse_requirement(answer.stated.requirement, schema);
    require_answerable(answer.requirement, objectives, "requirement", answer.stated.requirement);
    if (!answer.is_joint()) {
      answer.subject = requirement_subject(schema, answer.requirement.parameter);
    }
    answer.is_of_error = !answer.is_joint() && answer.requirement.parameter < objectives.size();
    rows_.push_back(
        {.answer = answer, .of_all = {Exceedances(answer.requirement, objectives, budget)}});
  }
}

void VerificationMatrix::add(const RunResult& result) {
  if (result.run.value >= judged_.end) return;
  // Where one of the first was given up, it is among all that were.
  if (num_fixed_ && num_runs_ - missing_.num_given_up == *num_fixed_ &&
      result.run.value == *num_fixed_) {
    missing_of_fixed_ = missing_;
    missing_of_fixed_.num_given_up = 0;
    for (Row& row : rows_) row.of_fixed = row.of_all;
  }
  ++num_runs_;
  missing_.add(result);
  if (!result.is_completed()) return;
  const bool tells_level = budget_ && budget_->level_of_run(result) != 0.0;
  for (Row& row : rows_) {
    const double value = row.of_all.exceedances.add(result);
    if (keeps_values(row)) row.values.push_back(value);
    if (row.answer.is_of_budget() && !tells_level) row.answer.assumption = assumed_level_;
    std::optional<RunValue>& worst = row.of_all.worst;
    if (!worst || value > worst->value) worst = {.run = result.run, .value = value};
  }
}

void VerificationMatrix::end_results() {
  if (have_results_ended_) return;
  have_results_ended_ = true;
  for (Row& row : rows_) {
    row.answer.missing = missing_;
    row.answer.worst = row.of_all.worst;
    row.answer.check =
        check_requirement(row.answer.requirement, row.of_all.exceedances.of(num_runs_), num_fixed_);
    if (row.of_fixed) keep_fixed_verdict(row);
    std::ranges::sort(row.values);
    row.set_bound(std::exchange(row.values, {}));
  }
}

void VerificationMatrix::keep_fixed_verdict(Row& row) const {
  RequirementAnswer& answer = row.answer;
  if (answer.check.verdict != RequirementVerdict::undecided) return;
  const RequirementCheck of_fixed =
      check_requirement(answer.requirement, row.of_fixed->exceedances.of(*num_fixed_), num_fixed_);
  if (of_fixed.verdict == RequirementVerdict::undecided) return;
  answer.check = of_fixed;
  answer.missing = missing_of_fixed_;
  answer.worst = row.of_fixed->worst;
  answer.of_all = row.of_all.exceedances.of(num_runs_);
}

void VerificationMatrix::Row::set_bound(std::span<const double> ascending) {
  if (answer.of_all) return;
  // Runs without an estimate are the largest errors.
  const std::uint64_t order = answer.check.bound_order, num_missing = answer.missing.total();
  if (ascending.empty() || order <= num_missing) return;
  answer.bound = ascending[static_cast<std::size_t>(ascending.size() - (order - num_missing))];
}

void VerificationMatrix::add_magnitudes(std::size_t parameter, std::span<const double> magnitudes) {
  end_results();
  for (Row& row : rows_) {
    if (!keeps_values(row) && row.answer.requirement.parameter == parameter) {
      row.set_bound(magnitudes);
    }
  }
}

std::vector<RequirementAnswer> VerificationMatrix::answers() {
  end_results();
  std::vector<RequirementAnswer> answers;
  for (const Row& row : rows_) answers.push_back(row.answer);
  return answers;
}

}  // namespace proofmass::coordinator
