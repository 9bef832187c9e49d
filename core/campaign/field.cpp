#include "core/campaign/field.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/error.hpp"

namespace proofmass {

bool Range::contains(double value) const {
  const bool above = minimum_open ? value > minimum : value >= minimum;
  return std::isfinite(value) && above && value <= maximum;
}

std::string Range::rule() const {
  const bool has_minimum = std::isfinite(minimum);
  const bool has_maximum = std::isfinite(maximum);
  if (has_minimum && has_maximum) {
    return fmt::format("must be in {}{}, {}]", minimum_open ? '(' : '[', minimum, maximum);
  }
  if (has_minimum) return fmt::format("must be {} {}", minimum_open ? ">" : ">=", minimum);
  if (has_maximum) return fmt::format("must be <= {}", maximum);
  return "must be finite";
}

void check_field(const FieldInfo& field, double value) {
  if (field.range.contains(value)) return;
  throw ConfigError(field.path, fmt::format("{}", value),
                    std::isfinite(value) ? field.range.rule() : "must be finite");
}

}  // namespace proofmass
