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

double* number_at(Dispersion& dispersion, std::string_view key) {
  if (key == "minimum") return &dispersion.minimum;
  if (key == "maximum") return &dispersion.maximum;
  if (key == "mean") return &dispersion.mean;
  if (key == "standard_deviation") return &dispersion.standard_deviation;
  if (key == "value") return &dispersion.value;
  return nullptr;
}

std::string* text_at(Dispersion& dispersion, std::string_view key) {
  if (key == "file") return &dispersion.file;
  if (key == "column") return &dispersion.column;
  if (key == "expression") return &dispersion.expression;
  return nullptr;
}

std::vector<double>* numbers_at(Dispersion& dispersion, std::string_view key) {
  if (key == "values") return &dispersion.values;
  if (key == "probabilities") return &dispersion.probabilities;
  if (key == "correlations") return &dispersion.correlations;
  return nullptr;
}

std::vector<std::string>* texts_at(Dispersion& dispersion, std::string_view key) {
  return key == "with" ? &dispersion.with : nullptr;
}

std::string_view name_of(Law law) { return names_of(law)[static_cast<std::size_t>(law) - 1]; }

}  // namespace proofmass
