#include "core/microscope/definition/dispersion_keys.hpp"

#include <array>
#include <cstddef>

#include "core/error.hpp"

namespace proofmass::detail {

std::span<const std::string_view> keys_of(Law law) {
  static constexpr std::array<std::string_view, 2> interval{"minimum", "maximum"};
  static constexpr std::array<std::string_view, 2> spread{"mean", "standard_deviation"};
  static constexpr std::array<std::string_view, 4> truncated{"mean", "standard_deviation",
                                                             "minimum", "maximum"};
  static constexpr std::array<std::string_view, 1> constant{"value"};
  static constexpr std::array<std::string_view, 2> source{"file", "column"};
  switch (law) {
    case Law::uniform:
      return interval;
    case Law::normal:
      return spread;
    case Law::truncated_normal:
      return truncated;
    case Law::fixed:
      return constant;
    case Law::table:
      return source;
  }
  PROOFMASS_EXPECT(!"every law has keys");
  return {};
}

std::string_view name_of(Law law) { return names_of(law)[static_cast<std::size_t>(law) - 1]; }

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
  return nullptr;
}

}  // namespace proofmass::detail
