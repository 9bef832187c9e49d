#include "coordinator/archive/drawn_columns.hpp"

#include <fmt/format.h>

#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {

std::string draw_column_name(std::size_t quantity) {
  return fmt::format("draw_{}", model().drawn()[quantity].name);
}

DrawnColumns::DrawnColumns(const Store& store, DrawColumns columns) {
  if (columns == DrawColumns::included) campaign_ = stored_campaign_unchecked(store);
}

std::size_t DrawnColumns::count() const { return campaign_ ? model().drawn().size() : 0; }

std::vector<double> DrawnColumns::values_of(RunIndex run) const {
  return campaign_ ? campaign_->draw(run).values : std::vector<double>();
}

}  // namespace proofmass::coordinator
