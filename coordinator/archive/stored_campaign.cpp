#include "coordinator/archive/stored_campaign.hpp"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/digest_check.hpp"

namespace proofmass::coordinator {

Campaign stored_campaign(const Store& store) {
  std::optional<Campaign> campaign;
  store.read_one_state([&] {
    check_definition_digest(store);
    campaign = stored_campaign_unchecked(store);
  });
  return *std::move(campaign);
}

Campaign stored_campaign_unchecked(const Store& store) {
  std::vector<std::vector<double>> columns;
  for (std::size_t element = 0; element < num_drawn; ++element) {
    const std::array elements{element};
    std::vector<double> column = std::move(store.table_columns(elements).front());
    if (!column.empty()) columns.push_back(std::move(column));
  }
  Campaign campaign = parse_campaign("stored definition", store.definition(),
                                     store.environment_table(), std::move(columns));
  require_identity(campaign, {.name = store.name(),
                              .seed = fmt::to_string(store.seed()),
                              .num_runs = fmt::to_string(store.num_runs())});
  return campaign;
}

}  // namespace proofmass::coordinator
