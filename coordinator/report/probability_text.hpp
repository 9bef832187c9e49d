#pragma once

#include <string>
#include <string_view>

#include "core/statistics/interval.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// `met`, `not met` or `undecided`.
[[nodiscard]] std::string_view name_of(Verdict verdict);

/// A fraction as it was asked for: 0.999999 is `99.9999 %`, not 100 %.
[[nodiscard]] std::string given_percent(double fraction);

/// `91.5 to 99.4 %`: both ends of an interval of a probability, to three digits or as many decimals
/// as keep 99.9996 % from being 100 %.
[[nodiscard]] std::string interval_percent(const Interval& interval);

/// The bound that a verdict was made by: `at most 0.9969 % of all draws, with 95 %` or `at least
/// ...`; both if there is none. A bound has as many digits as it takes to see on which side of the
/// limit it lies.
/// @param bounds  Each one-sided, of the probability of an exceedance.
/// @param limit   The probability that is allowed.
[[nodiscard]] std::string bounds_text(const Interval& bounds, double limit, Verdict verdict);

/// The same of the probability that a requirement holds, and of what is required.
[[nodiscard]] std::string success_text(const Interval& bounds, double required, Verdict verdict);

}  // namespace proofmass::coordinator
