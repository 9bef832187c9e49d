#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/campaign/sampling_design.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// Shape of a drawn quantity's distribution.
enum class Law : std::uint8_t {
  uniform = 1,           ///< On [minimum, maximum].
  normal = 2,            ///< mean, standard_deviation.
  truncated_normal = 3,  ///< mean, standard_deviation, on [minimum, maximum].
  fixed = 4,             ///< value.
  table = 5,             ///< One value a run, from a column of a file.
  discrete = 6,          ///< One of values, with probabilities.
  truncated = 7,         ///< As truncated_normal, from one deviate, and with the mean anywhere.
  derived = 8,           ///< expression, of other drawn quantities.
  correlated = 9,        ///< mean, standard_deviation, and correlations with other normal laws.
};

[[nodiscard]] std::span<const std::string_view> names_of(Law);

/// Most bytes of the name of a data file or of a column.
inline constexpr std::size_t data_name_size_max = 1024;

/// Most entries of a list that belongs to a law.
inline constexpr std::size_t law_list_size_max = 64;

/// Most bytes of an expression.
inline constexpr std::size_t expression_size_max = 1024;

/// The law of one drawn quantity; only the fields of its law mean something, the others are 0.
struct Dispersion {
  Law law = Law::uniform;
  double minimum = 0.0;
  double maximum = 0.0;
  double mean = 0.0;
  double standard_deviation = 0.0;
  double value = 0.0;
  std::string file = {};    ///< For `table`: path as written in the campaign file.
  std::string column = {};  ///< For `table`: heading of the column.
  /// For `table`: the values are independent draws of one law, and not those of a design.
  bool is_independent = false;
  std::vector<double> values = {};         ///< For `discrete`: what may be drawn.
  std::vector<double> probabilities = {};  ///< For `discrete`: of `values`; their sum is 1.
  std::string expression = {};             ///< For `derived`, see evaluate_expression().
  std::vector<std::string> with = {};      ///< For `correlated`: other quantities.
  std::vector<double> correlations = {};   ///< For `correlated`: with each of `with`.

  bool operator==(const Dispersion&) const = default;

  /// @throws ConfigError naming `path.field`, e.g. `dispersion.offcentring_m.minimum`.
  void validate(std::string_view path) const;
};

/// The value of a quantity in a run's draw number `draw` (from 0), before any acceptance rule: a
/// pure function of its arguments.
///
/// @param name         Of the quantity; that of its random stream, so it must never change.
/// @param table_value  Its value in this run, for the law `table`.
/// @param stratum      The part of the law in which the value is; in one of several,
///                     `truncated_normal` is drawn by its distribution function, as `truncated` is.
/// @pre The law needs no other quantity: it is neither `derived` nor `correlated`.
[[nodiscard]] double draw_value(const Dispersion& dispersion, std::string_view name,
                                std::uint64_t seed, RunIndex run, std::uint32_t draw,
                                double table_value, const Stratum& stratum = {});

/// The standard normal deviate that a quantity with the law `normal` or `correlated` follows.
[[nodiscard]] double draw_deviate(std::string_view name, std::uint64_t seed, RunIndex run,
                                  std::uint32_t draw, const Stratum& stratum = {});

/// Keys that a law has in a campaign file beside `law`, each named like its field of Dispersion.
[[nodiscard]] std::span<const std::string_view> keys_of(Law law);

/// A field of a Dispersion, of the type that its key has in a campaign file.
using LawField =
    std::variant<double*, std::string*, std::vector<double>*, std::vector<std::string>*>;

/// The field of one of keys_of() any law.
[[nodiscard]] LawField field_of(Dispersion& law, std::string_view key);

/// Mean and standard deviation of a law.
struct LawMoments {
  double mean = 0.0;
  double standard_deviation = 0.0;
};

/// Those of a valid law. Nothing for the laws `table` and `derived`, whose values follow from a
/// file or from other quantities.
///
/// A truncated normal law is integrated over the part of its interval that matters, which keeps the
/// digits far out in a tail and in slivers, where the closed form subtracts nearly equal numbers;
/// relative error of the standard deviation below 1e-6. The bits are the same on every processor.
[[nodiscard]] std::optional<LawMoments> moments_of(const Dispersion& law);

}  // namespace proofmass
