#include "core/campaign/dispersion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/random/stream.hpp"

namespace proofmass {

std::span<const std::string_view> names_of(Law) {
  static constexpr std::array<std::string_view, 9> names{"uniform",   "normal",  "truncated_normal",
                                                         "fixed",     "table",   "discrete",
                                                         "truncated", "derived", "correlated"};
  return names;
}

namespace {

/// Checks one law; `path` is that of its table in a campaign file.
class LawCheck {
 public:
  LawCheck(const Dispersion& law, std::string_view path) : law_(law), path_(path) {}

  void run() const {
    check_finite("minimum", law_.minimum);
    check_finite("maximum", law_.maximum);
    check_finite("mean", law_.mean);
    check_finite("standard_deviation", law_.standard_deviation);
    check_finite("value", law_.value);
    switch (law_.law) {
      case Law::uniform:
        return check_interval();
      case Law::normal:
        return check_spread();
      case Law::truncated_normal:
        return check_truncation();
      case Law::fixed:
        return;
      case Law::table:
        return check_source();
      case Law::discrete:
        return check_choices();
      case Law::truncated:
        return check_bounds();
      case Law::derived:
        return check_length("expression", law_.expression, expression_size_max);
      case Law::correlated:
        return check_correlations();
    }
    refuse("law", static_cast<int>(law_.law), "unknown law");
  }

 private:
  template <typename Value>
  [[noreturn]] void refuse(std::string_view key, const Value& value, std::string_view rule) const {
    throw ConfigError(fmt::format("{}.{}", path_, key), fmt::format("{}", value), rule);
  }

  void check_finite(std::string_view key, double value) const {
    if (!std::isfinite(value)) refuse(key, value, "must be finite");
  }

  void check_interval() const {
    if (law_.minimum >= law_.maximum) {
      refuse("maximum", law_.maximum, fmt::format("must be > minimum, {}", law_.minimum));
    }
    // The width is a number that the draw computes with.
    check_finite("maximum", law_.maximum - law_.minimum);
  }

  void check_spread() const {
    if (law_.standard_deviation > 0.0) return;
    refuse("standard_deviation", law_.standard_deviation, "must be > 0");
  }

  // Far tails and slivers would make a draw by rejection endless.
  void check_truncation() const {
    check_spread();
    check_interval();
    if (law_.mean < law_.minimum || law_.mean > law_.maximum) {
      refuse("mean", law_.mean, fmt::format("must be in [{}, {}]", law_.minimum, law_.maximum));
    }
    check_slimness(100.0);
  }

  // The inverse of the distribution function reaches as far as a double holds probabilities.
  void check_bounds() const {
    constexpr double deviations_max = 30.0;
    check_spread();
    check_interval();
    const double nearest = std::fmax(law_.minimum - law_.mean, law_.mean - law_.maximum);
    if (nearest > deviations_max * law_.standard_deviation) {
      refuse("mean", law_.mean,
             fmt::format("must be at most {} standard deviations beyond [{}, {}]", deviations_max,
                         law_.minimum, law_.maximum));
    }
    check_slimness(1e6);
  }

  void check_slimness(double slimness_max) const {
    const double widest = slimness_max * (law_.maximum - law_.minimum);
    if (law_.standard_deviation <= widest) return;
    refuse("standard_deviation", law_.standard_deviation,
           fmt::format("must be <= {:g} (maximum - minimum), {}", slimness_max, widest));
  }

  void check_choices() const {
    check_list("values", law_.values);
    check_list("probabilities", law_.probabilities);
    check_size("probabilities", law_.probabilities.size(), law_.values.size(), "value");
    double sum = 0.0;
    for (const double probability : law_.probabilities) {
      if (probability < 0.0) refuse("probabilities", probability, "must be >= 0");
      sum += probability;
    }
    if (std::abs(sum - 1.0) > 1e-9) {
      refuse("probabilities", fmt::format("{} together", sum), "must be 1, to 1e-9");
    }
  }

  void check_correlations() const {
    check_spread();
    check_list("correlations", law_.correlations);
    check_size("correlations", law_.correlations.size(), law_.with.size(), "quantity of `with`");
  }

  void check_list(std::string_view key, const std::vector<double>& list) const {
    if (list.empty() || list.size() > law_list_size_max) {
      refuse(key, fmt::format("{} of them", list.size()),
             fmt::format("must be 1 to {}", law_list_size_max));
    }
    for (const double value : list) check_finite(key, value);
  }

  void check_size(std::string_view key, std::size_t size, std::size_t wanted,
                  std::string_view each) const {
    if (size == wanted) return;
    refuse(key, fmt::format("{} of them", size),
           fmt::format("must be {}, one for each {}", wanted, each));
  }

  void check_source() const {
    if (law_.file.empty()) refuse("file", "\"\"", "must name a file");
    if (law_.column.empty()) refuse("column", "\"\"", "must name a column");
    check_length("file", law_.file, data_name_size_max);
    check_length("column", law_.column, data_name_size_max);
  }

  void check_length(std::string_view key, const std::string& text, std::size_t size_max) const {
    if (text.size() <= size_max) return;
    refuse(key, fmt::format("{} bytes", text.size()), fmt::format("must be at most {}", size_max));
  }

  const Dispersion& law_;
  std::string_view path_;
};

}  // namespace

void Dispersion::validate(std::string_view path) const { LawCheck(*this, path).run(); }

namespace {

/// Trials that one draw of a truncated normal may take. Validation keeps the mean inside the
/// interval and the standard deviation below 100 widths, so one trial succeeds with 0.4 % at least,
/// and all of them fail with less than 1e-7.
constexpr std::uint32_t blocks_per_draw = 4096;

double draw_truncated(const Dispersion& law, const RandomStream& stream,
                      std::uint32_t first_block) {
  for (std::uint32_t i = 0; i < blocks_per_draw; ++i) {
    const double value =
        law.mean + law.standard_deviation * inverse_normal(uniform(stream.block(first_block + i)));
    if (value >= law.minimum && value <= law.maximum) return value;
  }
  // All trials failed, which Dispersion::validate() keeps improbable.
  return std::fmin(std::fmax(law.mean, law.minimum), law.maximum);
}

/// Φ(x) for x ≤ 0, by bisection of its inverse over all doubles: with the bits that the inverse
/// has.
double normal_below(double x) {
  auto low = std::bit_cast<std::uint64_t>(1e-300);
  auto high = std::bit_cast<std::uint64_t>(0.5);
  if (x < inverse_normal(1e-300)) return 0.0;
  while (high - low > 1) {
    const std::uint64_t middle = low + (high - low) / 2;
    (inverse_normal(std::bit_cast<double>(middle)) < x ? low : high) = middle;
  }
  return std::bit_cast<double>(high);
}

/// A normal law on [minimum, maximum] by the inverse of its distribution function. It is computed
/// in the lower half, where small probabilities have all their digits.
double draw_within_bounds(const Dispersion& law, double uniform) {
  double from = (law.minimum - law.mean) / law.standard_deviation;
  double to = (law.maximum - law.mean) / law.standard_deviation;
  const bool is_mirrored = from > 0.0;
  if (is_mirrored) {
    from = -std::exchange(to, -from);
    uniform = 1.0 - uniform;
  }
  const double below = normal_below(from);
  const double within = (to > 0.0 ? 1.0 - normal_below(-to) : normal_below(to)) - below;
  const double deviate = inverse_normal(std::fmin(below + uniform * within, 1.0 - 0x1p-53));
  const double value = law.mean + law.standard_deviation * (is_mirrored ? -deviate : deviate);
  return std::fmin(std::fmax(value, law.minimum), law.maximum);
}

double chosen_value(const Dispersion& law, double uniform) {
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < law.values.size(); ++i) {
    sum += law.probabilities[i];
    if (uniform < sum) return law.values[i];
  }
  return law.values.back();
}

RandomStream stream_of(std::string_view name, std::uint64_t seed, RunIndex run) {
  return {seed, run, stream_id(fmt::format("draw/{}", name))};
}

}  // namespace

double draw_deviate(std::string_view name, std::uint64_t seed, RunIndex run, std::uint32_t draw,
                    const Stratum& stratum) {
  const RandomBlock block = stream_of(name, seed, run).block(draw * blocks_per_draw);
  return inverse_normal(uniform_in(stratum, block));
}

double draw_value(const Dispersion& dispersion, std::string_view name, std::uint64_t seed,
                  RunIndex run, std::uint32_t draw, double table_value, const Stratum& stratum) {
  const RandomStream stream = stream_of(name, seed, run);
  const std::uint32_t first_block = draw * blocks_per_draw;
  const auto probability = [&] { return uniform_in(stratum, stream.block(first_block)); };
  switch (dispersion.law) {
    case Law::uniform:
      return dispersion.minimum + (dispersion.maximum - dispersion.minimum) * probability();
    case Law::normal:
      return dispersion.mean +
             dispersion.standard_deviation * draw_deviate(name, seed, run, draw, stratum);
    case Law::truncated_normal:
      if (stratum.count > 1) return draw_within_bounds(dispersion, probability());
      return draw_truncated(dispersion, stream, first_block);
    case Law::fixed:
      return dispersion.value;
    case Law::table:
      return table_value;
    case Law::discrete:
      return chosen_value(dispersion, probability());
    case Law::truncated:
      return draw_within_bounds(dispersion, probability());
    case Law::derived:
    case Law::correlated:
      break;
  }
  PROOFMASS_EXPECT(false);
  return 0.0;
}

std::span<const std::string_view> keys_of(Law law) {
  static constexpr std::array<std::string_view, 2> interval{"minimum", "maximum"};
  static constexpr std::array<std::string_view, 2> spread{"mean", "standard_deviation"};
  static constexpr std::array<std::string_view, 4> truncated{"mean", "standard_deviation",
                                                             "minimum", "maximum"};
  static constexpr std::array<std::string_view, 1> constant{"value"};
  static constexpr std::array<std::string_view, 2> source{"file", "column"};
  static constexpr std::array<std::string_view, 2> choices{"values", "probabilities"};
  static constexpr std::array<std::string_view, 1> function{"expression"};
  static constexpr std::array<std::string_view, 4> relation{"mean", "standard_deviation", "with",
                                                            "correlations"};
  switch (law) {
    case Law::uniform:
      return interval;
    case Law::normal:
      return spread;
    case Law::truncated_normal:
    case Law::truncated:
      return truncated;
    case Law::fixed:
      return constant;
    case Law::table:
      return source;
    case Law::discrete:
      return choices;
    case Law::derived:
      return function;
    case Law::correlated:
      return relation;
  }
  PROOFMASS_EXPECT(!"every law has keys");
  return {};
}

LawField field_of(Dispersion& law, std::string_view key) {
  if (key == "minimum") return &law.minimum;
  if (key == "maximum") return &law.maximum;
  if (key == "mean") return &law.mean;
  if (key == "standard_deviation") return &law.standard_deviation;
  if (key == "value") return &law.value;
  if (key == "file") return &law.file;
  if (key == "column") return &law.column;
  if (key == "expression") return &law.expression;
  if (key == "values") return &law.values;
  if (key == "probabilities") return &law.probabilities;
  if (key == "correlations") return &law.correlations;
  return &law.with;
}

namespace {

/// Of the standard normal law on [from, to], by Simpson's rule about the peak of the density.
LawMoments truncated_moments(double from, double to) {
  // At a distance t from the peak p the density is exp(−t²/2 − |p| t) of that at the peak; what is
  // below exp(−40) of it is left out.
  constexpr double exponent_max = 40.0;
  const double peak = std::clamp(0.0, from, to);
  const double reach =
      2.0 * exponent_max / (std::abs(peak) + std::sqrt(peak * peak + 2.0 * exponent_max));
  const double first = std::max(from - peak, -reach), last = std::min(to - peak, reach);

  constexpr std::size_t num_steps = 1024;
  const double step = (last - first) / static_cast<double>(num_steps);
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i <= num_steps; ++i) {
    const double t = first + step * static_cast<double>(i);
    const double factor = i == 0 || i == num_steps ? 1.0 : (i % 2 == 0 ? 2.0 : 4.0);
    const double weight = factor * exponential(-t * (0.5 * t + peak));
    sum += weight;
    mean += weight * t;
    square += weight * t * t;
  }
  mean /= sum;
  return {peak + mean, std::sqrt(std::max(square / sum - mean * mean, 0.0))};
}

LawMoments discrete_moments(const Dispersion& law) {
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i < law.values.size(); ++i) {
    sum += law.probabilities[i];
    mean += law.probabilities[i] * law.values[i];
  }
  mean /= sum;
  for (std::size_t i = 0; i < law.values.size(); ++i) {
    const double distance = law.values[i] - mean;
    square += law.probabilities[i] * distance * distance;
  }
  return {mean, std::sqrt(square / sum)};
}

}  // namespace

std::optional<LawMoments> moments_of(const Dispersion& law) {
  switch (law.law) {
    case Law::uniform:
      return LawMoments{0.5 * (law.minimum + law.maximum),
                        (law.maximum - law.minimum) / std::sqrt(12.0)};
    case Law::normal:
    case Law::correlated:
      return LawMoments{law.mean, law.standard_deviation};
    case Law::truncated_normal:
    case Law::truncated: {
      const auto standard = truncated_moments((law.minimum - law.mean) / law.standard_deviation,
                                              (law.maximum - law.mean) / law.standard_deviation);
      return LawMoments{law.mean + law.standard_deviation * standard.mean,
                        law.standard_deviation * standard.standard_deviation};
    }
    case Law::fixed:
      return LawMoments{law.value, 0.0};
    case Law::discrete:
      return discrete_moments(law);
    case Law::table:
    case Law::derived:
      break;
  }
  return std::nullopt;
}

}  // namespace proofmass
