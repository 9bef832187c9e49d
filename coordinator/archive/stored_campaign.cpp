#include "coordinator/archive/stored_campaign.hpp"

#include <fmt/format.h>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/digest_check.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {

std::shared_ptr<const Campaign> stored_campaign(const Store& store) {
  std::shared_ptr<const Campaign> campaign;
  store.read_one_state([&] {
    check_definition_digest(store);
    campaign = stored_campaign_unchecked(store);
  });
  return campaign;
}

std::shared_ptr<const Campaign> stored_campaign_unchecked(const Store& store) {
  std::shared_ptr<const Campaign> campaign =
      model().campaign_of({.text = store.definition(),
                           .tables = store.data_tables(),
                           .table_columns = store.table_columns()},
                          TableColumns::included, "stored definition");
  require_identity(*campaign, {.name = store.name(),
                               .seed = fmt::to_string(store.seed()),
                               .num_runs = fmt::to_string(store.num_runs())});
  return campaign;
}

}  // namespace proofmass::coordinator
