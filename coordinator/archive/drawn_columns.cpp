#include "coordinator/archive/drawn_columns.hpp"

#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/drawn_quantities.hpp"

namespace proofmass::coordinator {

std::string draw_column_name(std::size_t quantity) { return "draw_" + drawn_names()[quantity]; }

DrawnColumns::DrawnColumns(const Store& store, DrawColumns columns) {
  if (columns == DrawColumns::included) campaign_ = stored_campaign_unchecked(store);
}

std::optional<DrawnValues> DrawnColumns::values_of(RunIndex run) const {
  return campaign_ ? accepted_values(*campaign_, run) : std::nullopt;
}

}  // namespace proofmass::coordinator
