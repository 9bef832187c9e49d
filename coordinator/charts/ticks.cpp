#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>

#include "coordinator/charts/chart.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::array mantissas{1.0, 2.0, 5.0};
constexpr std::string_view minus_sign = "\u2212";

/// Correctly rounded: std::pow is not the same on every machine.
double power_of_ten(int exponent) { return std::stod(fmt::format("1e{}", exponent)); }

/// The largest k with 10ᵏ ≤ value. @pre value > 0 and finite.
int decade_of(double value) {
  int decade = static_cast<int>(std::floor(std::log10(value)));
  if (power_of_ten(decade) > value) --decade;
  if (power_of_ten(decade + 1) <= value) ++decade;
  return decade;
}

std::string with_minus(std::string_view text) {
  return text.starts_with('-') ? std::string(minus_sign) + std::string(text.substr(1))
                               : std::string(text);
}

std::string superscript(int number) {
  constexpr std::array<std::string_view, 10> digits{"⁰", "¹", "²", "³", "⁴",
                                                    "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char digit : std::to_string(std::abs(number))) {
    text += digits.at(static_cast<std::size_t>(digit - '0'));
  }
  return text;
}

std::string with_exponent(std::string_view mantissa, int exponent) {
  const std::string power = "10" + superscript(exponent);
  if (mantissa == "1") return power;
  if (mantissa == "-1") return std::string(minus_sign) + power;
  return with_minus(mantissa) + "×" + power;
}

/// Of `{:.Ne}`, without zeros that say nothing.
std::string from_scientific(std::string_view text) {
  const std::size_t e = text.find('e');
  std::string_view mantissa = text.substr(0, e);
  if (mantissa.find('.') != std::string_view::npos) {
    while (mantissa.ends_with('0')) mantissa.remove_suffix(1);
    if (mantissa.ends_with('.')) mantissa.remove_suffix(1);
  }
  return with_exponent(mantissa, std::stoi(std::string(text.substr(e + 1))));
}

/// The label of a multiple of a step, whose last digit counts.
std::string tick_label(double value, double step) {
  if (value == 0.0) return "0";
  const int last_digit = decade_of(step);
  const int first_digit = decade_of(std::abs(value));
  if (first_digit >= 5 || last_digit < -3) {
    const int num_decimals = std::clamp(first_digit - last_digit, 0, 15);
    return from_scientific(fmt::format("{:.{}e}", value, num_decimals));
  }
  return with_minus(fmt::format("{:.{}f}", value, std::max(-last_digit, 0)));
}

/// A step, as a whole multiple of a power of ten, so that multiples are rounded once.
struct Step {
  double mantissa = 1.0;
  int exponent = 0;

  [[nodiscard]] double times(double count) const {
    // A power of ten below 1 is no double, its inverse is one.
    return exponent < 0 ? count * mantissa / power_of_ten(-exponent)
                        : count * mantissa * power_of_ten(exponent);
  }
  [[nodiscard]] double size() const { return times(1.0); }
};

// Ends that lack their tick by a rounding error have it.
constexpr double tolerance = 1e-9;

Step step_for(double from, double to, std::size_t num_ticks_max) {
  for (int exponent = decade_of((to - from) / static_cast<double>(num_ticks_max));; ++exponent) {
    for (const double mantissa : mantissas) {
      const Step step{.mantissa = mantissa, .exponent = exponent};
      const double num_steps =
          std::ceil(to / step.size() - tolerance) - std::floor(from / step.size() + tolerance);
      if (num_steps + 1.0 <= static_cast<double>(num_ticks_max)) return step;
    }
  }
}

bool is_end(const std::optional<double>& end, Scale scale) {
  return end && std::isfinite(*end) && (scale == Scale::linear || *end > 0.0);
}

/// 1, 2 or 5 times a power of ten, at `value` or next to it.
double round_outwards(double value, bool is_upper) {
  const int decade = decade_of(value);
  double result = power_of_ten(decade);
  for (const double mantissa : {2.0, 5.0, 10.0}) {
    const double next = Step{mantissa, decade}.size();
    if (is_upper) {
      if (result >= value * (1.0 - tolerance)) return result;
      result = next;
    } else if (next <= value * (1.0 + tolerance)) {
      result = next;
    }
  }
  return result;
}

void add_ticks(AxisRange& range, int decade, std::span<const double> of_decade) {
  for (const double mantissa : of_decade) {
    const double value = Step{mantissa, decade}.size();
    if (value < range.from * (1.0 - tolerance) || value > range.to * (1.0 + tolerance)) continue;
    range.ticks.push_back({value, figure_text(value)});
  }
}

}  // namespace

std::string figure_text(double value) {
  if (value == 0.0) return "0";
  if (!std::isfinite(value)) return fmt::format("{}", value);
  const std::string scientific = fmt::format("{:.2e}", value);
  const int exponent = std::stoi(scientific.substr(scientific.find('e') + 1));
  if (exponent < -3 || exponent > 4) return from_scientific(scientific);
  if (exponent >= 3) return with_minus(fmt::format("{:.0f}", value));
  // Rounded to three digits first, and then written without an exponent.
  return with_minus(fmt::format("{:.10g}", std::stod(scientific)));
}

std::string unit_text(std::string_view unit) {
  if (!unit.starts_with("1e")) return std::string(unit);
  const std::size_t end = std::min(unit.find(' '), unit.size());
  return "10" + superscript(std::stoi(std::string(unit.substr(2, end - 2)))) +
         std::string(unit.substr(end));
}

AxisRange linear_range(const ChartAxis& axis, double from, double to, std::size_t num_ticks_max) {
  const bool has_from = is_end(axis.from, Scale::linear);
  const bool has_to = is_end(axis.to, Scale::linear);
  AxisRange range{.from = has_from ? *axis.from : from, .to = has_to ? *axis.to : to};
  // Differences that a double hardly holds are no range either.
  const double least = std::max(std::abs(range.from), std::abs(range.to)) * 1e-12;
  if (!(range.to - range.from > least)) {
    range.to = range.from + (range.from == 0.0 ? 1.0 : std::abs(range.from));
  }
  const Step step = step_for(range.from, range.to, num_ticks_max);
  const double size = step.size();
  if (!has_from) range.from = step.times(std::floor(range.from / size + tolerance));
  if (!has_to) range.to = step.times(std::ceil(range.to / size - tolerance));
  const double last = std::floor(range.to / size + tolerance);
  for (double count = std::ceil(range.from / size - tolerance); count <= last; count += 1.0) {
    const double value = step.times(count);
    range.ticks.push_back({value, tick_label(value, size)});
  }
  return range;
}

AxisRange logarithmic_range(const ChartAxis& axis, double from, double to,
                            std::size_t num_ticks_max) {
  AxisRange range{
      .from = is_end(axis.from, Scale::logarithmic) ? *axis.from : round_outwards(from, false),
      .to = is_end(axis.to, Scale::logarithmic) ? *axis.to : round_outwards(to, true)};
  if (!(range.to > range.from)) range.to = 10.0 * range.from;
  const int first = decade_of(range.from);
  const int last = decade_of(range.to);
  for (int decade = first; decade <= last; ++decade) add_ticks(range, decade, mantissas);
  const bool are_few_powers = range.to / range.from < 100.0;
  if (are_few_powers || range.ticks.size() <= num_ticks_max) return range;
  range.ticks.clear();
  const int stride = 1 + (last - first) / static_cast<int>(num_ticks_max);
  for (int decade = first; decade <= last; ++decade) {
    if (decade % stride == 0) add_ticks(range, decade, std::array{1.0});
  }
  return range;
}

}  // namespace proofmass::coordinator
