#include "coordinator/report/probability_text.hpp"

#include <fmt/format.h>

#include <string>

#include "core/error.hpp"

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

}  // namespace

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

std::string given_percent(double fraction) { return fmt::format("{:.12g} %", 100.0 * fraction); }

std::string interval_percent(const Interval& interval) {
  return fmt::format("{} to {} %", short_percent(interval.lower), short_percent(interval.upper));
}

std::string bounds_text(const Interval& bounds, double limit, Verdict verdict) {
  const std::string confidence = given_percent(bounds.confidence);
  const std::string lower = percent_beside(bounds.lower, limit);
  const std::string upper = percent_beside(bounds.upper, limit);
  if (verdict == Verdict::met) {
    return fmt::format("at most {} of all draws, with {}", upper, confidence);
  }
  if (verdict == Verdict::not_met) {
    return fmt::format("at least {} of all draws, with {}", lower, confidence);
  }
  return fmt::format("at least {} and at most {} of all draws, each with {}", lower, upper,
                     confidence);
}

std::string success_text(const Interval& bounds, double required, Verdict verdict) {
  // What is above the requirement meets it: as what is below the limit does, the other way round.
  if (verdict == Verdict::met) return bounds_text(bounds, required, Verdict::not_met);
  if (verdict == Verdict::not_met) return bounds_text(bounds, required, Verdict::met);
  return bounds_text(bounds, required, verdict);
}

}  // namespace proofmass::coordinator
