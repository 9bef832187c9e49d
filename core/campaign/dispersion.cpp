#include "core/campaign/dispersion.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <utility>

#include "core/error.hpp"
#include "core/random/normal.hpp"
#include "core/random/stream.hpp"

namespace proofmass {

std::span<const std::string_view> names_of(Law) {
  static constexpr std::array<std::string_view, 5> names{"uniform", "normal", "truncated_normal",
                                                         "fixed", "table"};
  return names;
}

namespace {

/// Checks one law; `path` is that of its table in a campaign file.
class DispersionCheck {
 public:
  DispersionCheck(const Dispersion& dispersion, std::string_view path)
      : dispersion_(dispersion), path_(path) {}

  void run() const {
    check_finite("minimum", dispersion_.minimum);
    check_finite("maximum", dispersion_.maximum);
    check_finite("mean", dispersion_.mean);
    check_finite("standard_deviation", dispersion_.standard_deviation);
    check_finite("value", dispersion_.value);
    switch (dispersion_.law) {
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
    }
    refuse("law", fmt::format("{}", static_cast<int>(dispersion_.law)), "unknown law");
  }

 private:
  [[noreturn]] void refuse(std::string_view key, std::string_view value,
                           std::string_view rule) const {
    throw ConfigError(fmt::format("{}.{}", path_, key), value, rule);
  }

  void check_finite(std::string_view key, double value) const {
    if (!std::isfinite(value)) refuse(key, fmt::format("{}", value), "must be finite");
  }

  void check_interval() const {
    if (dispersion_.minimum < dispersion_.maximum) {
      // The width is a number that the draw computes with.
      check_finite("maximum", dispersion_.maximum - dispersion_.minimum);
      return;
    }
    refuse("maximum", fmt::format("{}", dispersion_.maximum),
           fmt::format("must be > minimum, {}", dispersion_.minimum));
  }

  void check_spread() const {
    if (dispersion_.standard_deviation > 0.0) return;
    refuse("standard_deviation", fmt::format("{}", dispersion_.standard_deviation), "must be > 0");
  }

  // Far tails and slivers would make a draw by rejection endless.
  void check_truncation() const {
    check_spread();
    check_interval();
    if (dispersion_.mean < dispersion_.minimum || dispersion_.mean > dispersion_.maximum) {
      refuse("mean", fmt::format("{}", dispersion_.mean),
             fmt::format("must be in [{}, {}]", dispersion_.minimum, dispersion_.maximum));
    }
    const double width = dispersion_.maximum - dispersion_.minimum;
    if (dispersion_.standard_deviation > 100.0 * width) {
      refuse("standard_deviation", fmt::format("{}", dispersion_.standard_deviation),
             fmt::format("must be <= 100 (maximum - minimum), {}", 100.0 * width));
    }
  }

  void check_source() const {
    if (dispersion_.file.empty()) refuse("file", "\"\"", "must name a file");
    if (dispersion_.column.empty()) refuse("column", "\"\"", "must name a column");
    check_length("file", dispersion_.file);
    check_length("column", dispersion_.column);
  }

  void check_length(std::string_view key, const std::string& name) const {
    if (name.size() <= data_name_size_max) return;
    refuse(key, fmt::format("{} bytes", name.size()),
           fmt::format("must be at most {}", data_name_size_max));
  }

  const Dispersion& dispersion_;
  std::string_view path_;
};

}  // namespace

void Dispersion::validate(std::string_view path) const { DispersionCheck(*this, path).run(); }

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
  // All trials failed: the bound on the probability stands above.
  return std::fmin(std::fmax(law.mean, law.minimum), law.maximum);
}

}  // namespace

double draw_value(const Dispersion& dispersion, std::string_view name, std::uint64_t seed,
                  RunIndex run, std::uint32_t draw, double table_value) {
  const RandomStream stream(seed, run, stream_id(fmt::format("draw/{}", name)));
  const std::uint32_t block = draw * blocks_per_draw;
  switch (dispersion.law) {
    case Law::uniform:
      return dispersion.minimum +
             (dispersion.maximum - dispersion.minimum) * uniform(stream.block(block));
    case Law::normal:
      return dispersion.mean +
             dispersion.standard_deviation * inverse_normal(uniform(stream.block(block)));
    case Law::truncated_normal:
      return draw_truncated(dispersion, stream, block);
    case Law::fixed:
      return dispersion.value;
    case Law::table:
      return table_value;
  }
  PROOFMASS_EXPECT(false);
  return 0.0;
}

}  // namespace proofmass
