#include "core/campaign/law_keys.hpp"

#include <array>

#include "core/error.hpp"

namespace proofmass {

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

}  // namespace proofmass
