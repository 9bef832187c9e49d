#include "core/statistics/stop_rule.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "core/error.hpp"
#include "core/statistics/detail/phrase.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t first_stop_check = 128;

/// The percentile that a name such as `p95` stands for.
std::optional<int> percent_of(std::string_view name) {
  int percent = 0;
  if (!name.starts_with('p')) return std::nullopt;
  const auto [end, error] = std::from_chars(name.data() + 1, name.data() + name.size(), percent);
  if (error != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return percent >= 1 && percent <= 99 ? std::optional(percent) : std::nullopt;
}

void read_statistic(detail::Phrase& phrase, StopRule& rule) {
  const std::string_view name = phrase.word();
  if (name == "mean") {
    rule.statistic = StopRule::Statistic::mean;
  } else if (name == "std") {
    rule.statistic = StopRule::Statistic::standard_deviation;
  } else if (const std::optional<int> percent = percent_of(name)) {
    rule.statistic = StopRule::Statistic::percentile;
    rule.level = *percent / 100.0;
  } else {
    phrase.refuse(
        fmt::format("{} is no statistic; they are mean, std and p1 to p99, and a requirement "
                    "ends with \"decided\"",
                    name));
  }
}

StopCheck estimated(const StopRule& rule, std::span<const double> errors) {
  StopCheck check;
  switch (rule.statistic) {
    case StopRule::Statistic::mean: {
      const Moments about = moments(errors);
      check.estimate = about.mean;
      check.interval = mean_interval(about, default_confidence);
      check.is_too_skewed = is_too_skewed(about.skewness, about.count);
      break;
    }
    case StopRule::Statistic::standard_deviation: {
      const Moments about = moments(errors);
      check.estimate = about.standard_deviation;
      check.interval = bootstrap_deviation_interval(errors, default_confidence);
      check.is_too_skewed = is_too_skewed(about.skewness, about.count);
      break;
    }
    case StopRule::Statistic::percentile: {
      const std::vector<double> ascending = sorted(errors);
      check.estimate = percentile(ascending, rule.level);
      check.interval = percentile_interval(ascending, rule.level, default_confidence);
      break;
    }
    case StopRule::Statistic::success:
    case StopRule::Statistic::verdict:
      PROOFMASS_EXPECT(false);
  }
  return check;
}

void check_width(const StopRule& rule, StopCheck& check) {
  if (!check.interval) return;
  const double half_width = 0.5 * (check.interval->upper - check.interval->lower);
  // Values that are all equal say nothing of those that are rare.
  if (half_width == 0.0) return;
  const double relative = half_width / std::abs(check.estimate);
  if (!std::isfinite(relative)) return;
  check.relative_half_width = relative;
  check.is_reached = relative <= rule.relative_half_width && !check.is_too_skewed;
}

StopRule rule_about_verdict(detail::Phrase& phrase) {
  StopRule rule{.statistic = StopRule::Statistic::verdict,
                .requirement = detail::read_requirement(phrase)};
  phrase.expect("decided");
  phrase.expect_end();
  return rule;
}

}  // namespace

StopRule parse_stop_rule(std::string_view text, std::span<const std::string_view> parameters) {
  detail::Phrase phrase(
      "until", text,
      "STATISTIC(PARAMETER) within PERCENT%\", \"all objectives within PERCENT%\" "
      "or \"REQUIREMENT decided",
      parameters);
  if (phrase.ends_with("decided")) return rule_about_verdict(phrase);
  StopRule rule;
  if (phrase.takes(all_objectives_word)) {
    phrase.expect("objectives");
    rule.statistic = StopRule::Statistic::success;
    rule.requirement.subject = Requirement::Subject::all_objectives;
  } else {
    read_statistic(phrase, rule);
    phrase.expect("(");
    rule.parameter = phrase.parameter();
    phrase.expect(")");
  }
  phrase.expect("within");
  rule.relative_half_width = phrase.percentage();
  phrase.expect_end();
  return rule;
}

std::string_view statistic_of(std::string_view text) {
  const std::size_t end = text.find(')');
  if (end != std::string_view::npos) return text.substr(0, end + 1);
  const std::string_view about = text.substr(0, text.find("within"));
  const std::size_t first = std::min(about.find_first_not_of(" \t"), about.size());
  return about.substr(first, about.find_last_not_of(" \t") + 1 - first);
}

bool is_about_exceedances(const StopRule& rule) {
  return rule.statistic == StopRule::Statistic::success ||
         rule.statistic == StopRule::Statistic::verdict;
}

std::uint64_t next_stop_check(std::uint64_t num_runs) {
  std::uint64_t count = first_stop_check;
  while (count <= num_runs) {
    if (count + count / 2 > num_runs) return count + count / 2;
    count *= 2;
  }
  return count;
}

StopCheck check_stop_rule(const StopRule& rule, std::span<const double> errors) {
  if (errors.empty()) return {};
  StopCheck check = estimated(rule, errors);
  check_width(rule, check);
  return check;
}

StopCheck check_stop_rule(const StopRule& rule, const ExceedanceCount& count,
                          std::optional<std::uint64_t> num_fixed) {
  PROOFMASS_EXPECT(is_about_exceedances(rule) && count.num_exceedances <= count.num_runs);
  if (count.num_runs == 0) return {};
  StopCheck check;
  const auto num_runs = static_cast<double>(count.num_runs);
  if (rule.statistic == StopRule::Statistic::verdict) {
    const Decision decision = decide(rule.requirement.tolerance, count, num_fixed);
    check.estimate = static_cast<double>(count.num_exceedances) / num_runs;
    check.interval = decision.exceedance;
    check.is_reached = decision.verdict != RequirementVerdict::undecided;
    return check;
  }
  const auto num_successes = static_cast<double>(count.num_runs - count.num_exceedances);
  check.estimate = num_successes / num_runs;
  check.interval = probability_interval(num_successes, num_runs, default_confidence);
  check_width(rule, check);
  return check;
}

}  // namespace proofmass
