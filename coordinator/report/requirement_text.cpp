#include "coordinator/report/requirement_text.hpp"

#include <fmt/format.h>

#include <cmath>

#include "coordinator/report/digest_check.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/run_ranges.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::met:
      return "met";
    case Verdict::not_met:
      return "not met";
    case Verdict::undecided:
      return "undecided";
  }
  PROOFMASS_EXPECT(false);
}

/// Keeps the errors of one parameter, 8 bytes a run, at a time.
void check(const Store& store, RequirementAnswer& answer) {
  const Parameter parameter = answer.requirement.parameter;
  answer.missing = {.num_given_up = num_runs_in(store.given_up_runs())};
  std::vector<double> errors;
  (void)walk_checked(store, [&](const RunResult& result) {
    require_in_range(result);
    answer.missing.add(result);
    if (result.has_estimate()) errors.push_back(std::abs(result.error(parameter)));
  });
  answer.check = check_requirement(answer.requirement, errors, answer.missing.total());
}

std::string percent(double fraction) { return fmt::format("{:.4g} %", 100.0 * fraction); }

// As it was asked for: 99.9999 % is not 100 %.
std::string given_percent(double fraction) { return fmt::format("{:.12g} %", 100.0 * fraction); }

std::string exceedance_line(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const std::string counts =
      fmt::format("Exceeding    {} of {} runs", check.num_exceedances, check.num_runs);
  constexpr std::size_t margin = 13;
  std::string text = counts + "\n";
  if (check.exceedance) {
    text = line_of(counts + ";",
                   fmt::format("{} to {} of all draws (95 % interval)",
                               percent(check.exceedance->lower), percent(check.exceedance->upper)),
                   margin);
  }
  if (check.num_without_estimate == 0) return text;
  return text + fmt::format("{0:{1}}{2} of them for want of an estimate:\n{0:{1}}{3}\n", "", margin,
                            check.num_without_estimate, reasons_text(answer.missing));
}

std::string bound_line(const RequirementAnswer& answer) {
  const RequirementCheck& check = answer.check;
  const Tolerance& tolerance = answer.requirement.tolerance;
  if (!check.bound) {
    // Runs without an estimate are the largest errors.
    const auto least = wilks_num_runs(tolerance, check.num_without_estimate + 1);
    return fmt::format("Bound        none: {} for {} with {}\n",
                       least ? fmt::format("{} draws at least,", *least) : "no number of draws",
                       given_percent(tolerance.coverage), given_percent(tolerance.confidence));
  }
  const ParameterInfo& info = parameter_infos()[index(answer.requirement.parameter)];
  return fmt::format("Bound        {} of all draws below {:.6g}{}{}, with {}\n",
                     given_percent(tolerance.coverage), check.bound->value,
                     info.unit == "1" ? "" : " ", info.unit == "1" ? "" : info.unit,
                     given_percent(tolerance.confidence));
}

std::string needed_line(const RequirementCheck& check) {
  if (check.verdict != Verdict::undecided) return "";
  const auto count = [](const std::optional<std::uint64_t>& num_runs) {
    return num_runs ? std::to_string(*num_runs) : "none";
  };
  return fmt::format(
      "Draws        {} meet it if no further one exceeds it,\n"
      "             {} decide if they go on to exceed it as often\n",
      count(check.num_runs_at_best), count(check.num_runs_at_this_rate));
}

}  // namespace

std::vector<RequirementAnswer> check_requirements(const Store& store,
                                                  std::span<const std::string> texts) {
  std::vector<RequirementAnswer> answers;
  for (const std::string& text : texts) {
    answers.push_back(
        {.text = text, .requirement = parse_requirement(text), .check = {}, .missing = {}});
  }
  for (RequirementAnswer& answer : answers) {
    store.read_one_state([&] { check(store, answer); });
  }
  return answers;
}

std::string requirement_text(const RequirementAnswer& answer) {
  return fmt::format("Requirement  {}\nAnswer       {}\n{}{}{}", answer.text,
                     name_of(answer.check.verdict), exceedance_line(answer), bound_line(answer),
                     needed_line(answer.check));
}

}  // namespace proofmass::coordinator
