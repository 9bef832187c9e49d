#include "core/statistics/stop_rule.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "core/statistics/detail/check.hpp"
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
    phrase.refuse(fmt::format("{} is no statistic; they are mean, std and p1 to p99", name));
  }
}

StopCheck estimated(const StopRule& rule, const ValuePasses& errors) {
  StopCheck check;
  switch (rule.statistic) {
    case StopRule::Statistic::mean:
      check.estimate = errors.moments().mean;
      check.interval = mean_interval(errors.moments(), default_confidence);
      break;
    case StopRule::Statistic::standard_deviation:
      check.estimate = errors.moments().standard_deviation;
      check.interval = errors.deviation_interval();
      break;
    case StopRule::Statistic::percentile:
      check.estimate = errors.percentile(rule.level);
      check.interval = errors.percentile_interval(rule.level);
      break;
  }
  return check;
}

}  // namespace

StopRule parse_stop_rule(std::string_view text) {
  detail::Phrase phrase("until", text, "STATISTIC(PARAMETER) within PERCENT%");
  StopRule rule;
  read_statistic(phrase, rule);
  phrase.expect("(");
  rule.parameter = phrase.parameter();
  phrase.expect(")");
  phrase.expect("within");
  rule.relative_half_width = phrase.percentage();
  phrase.expect_end();
  return rule;
}

std::uint64_t next_stop_check(std::uint64_t num_runs) {
  std::uint64_t count = first_stop_check;
  while (count <= num_runs) {
    if (count + count / 2 > num_runs) return count + count / 2;
    count *= 2;
  }
  return count;
}

ValuePasses::Wanted wanted_by(const StopRule& rule) {
  ValuePasses::Wanted wanted;
  if (rule.statistic == StopRule::Statistic::percentile) wanted.levels = {rule.level};
  wanted.has_deviation_interval = rule.statistic == StopRule::Statistic::standard_deviation;
  return wanted;
}

StopCheck check_stop_rule(const StopRule& rule, std::span<const double> errors) {
  detail::check_values("errors", errors, 0);
  ValuePasses passes(wanted_by(rule));
  do {
    for (const double error : errors) passes.add(error);
  } while (passes.end_pass());
  return check_stop_rule(rule, passes);
}

StopCheck check_stop_rule(const StopRule& rule, const ValuePasses& errors) {
  if (errors.count() == 0) return {};
  StopCheck check = estimated(rule, errors);
  if (!check.interval) return check;
  const double half_width = 0.5 * (check.interval->upper - check.interval->lower);
  const double relative = half_width == 0.0 ? 0.0 : half_width / std::abs(check.estimate);
  if (!std::isfinite(relative)) return check;
  check.relative_half_width = relative;
  check.is_reached = *check.relative_half_width <= rule.relative_half_width;
  return check;
}

}  // namespace proofmass
