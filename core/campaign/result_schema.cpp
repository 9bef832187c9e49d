#include "core/campaign/result_schema.hpp"

#include <algorithm>

#include "core/error.hpp"

namespace proofmass {

std::string_view name_at(const std::vector<std::string_view>& names, std::uint32_t position) {
  PROOFMASS_EXPECT(position <= names.size());
  return position == 0 ? "none" : names[position - 1];
}

std::optional<std::size_t> find_quantity(const ResultSchema& schema, std::string_view name) {
  const auto found = std::ranges::find(schema.quantities, name, &Quantity::name);
  if (found == schema.quantities.end()) return std::nullopt;
  return static_cast<std::size_t>(found - schema.quantities.begin());
}

std::vector<std::string_view> quantity_names(const ResultSchema& schema) {
  std::vector<std::string_view> names;
  for (const Quantity& quantity : schema.quantities) names.push_back(quantity.name);
  return names;
}

}  // namespace proofmass
