#include "coordinator/cli/campaign_start.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "coordinator/cli/exit_code.hpp"
#include "core/campaign/model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

std::string text_of(const Campaign& campaign) {
  return campaign.definition(TableColumns::left_out).text;
}

}  // namespace

void require_same(const Store& store, const Campaign& wanted, const std::filesystem::path& database,
                  std::string_view remedy) {
  std::vector<std::string> differences = definition_differences(*stored_campaign(store), wanted);
  if (store.model_version() != model().version()) {
    differences.push_back(fmt::format("model: {} in the database, {} in this program",
                                      store.model_version(), model().version()));
  }
  if (differences.empty()) return;
  std::string text = fmt::format("{} holds another campaign:", database.string());
  for (const std::string& difference : differences) {
    text += fmt::format("\n  {}", wire::visible_text(difference));
  }
  throw UsageError(fmt::format("{}\n{}", text, remedy));
}

void extend_same(Store& store, const Campaign& wanted, const std::filesystem::path& database) {
  const std::uint64_t num_runs = store.num_runs();
  if (wanted.num_runs < num_runs) {
    throw UsageError(
        fmt::format("campaign.runs = {} (must be at least {}, which {} was asked for; the number "
                    "comes from --runs, or else from the campaign file)",
                    wanted.num_runs, num_runs, database.string()));
  }
  if (wanted.num_runs > num_runs) store.extend(wanted, text_of(wanted));
}

ServedCampaign open_or_create(const Campaign& wanted, const StopPlan& plan,
                              const std::filesystem::path& database, std::string_view remedy,
                              const Asker& asker) {
  if (!plan.stop_rule.empty() && !wanted.table_columns.empty()) {
    throw UsageError(fmt::format("until = {} (must not be with quantities whose law is a table)",
                                 plan.stop_rule));
  }
  // Shared with the dispatch and with messages under way.
  const std::shared_ptr<Campaign> campaign = wanted.clone();
  const auto set_horizon = [&](std::uint64_t num_runs_now) {
    campaign->num_runs = horizon_of(plan, wanted.num_runs, num_runs_now);
  };
  const bool is_new = !std::filesystem::exists(database);
  if (is_new) set_horizon(0);
  Store store =
      is_new ? Store::create(database, *campaign, text_of(*campaign)) : Store::open(database);
  if (is_new) {
    if (!asker.name.empty()) store.set_owner(asker.name);
  } else {
    require_control(asker, wanted.name, store.owner());
    set_horizon(store.num_runs());
    require_same(store, *campaign, database, remedy);
    extend_same(store, *campaign, database);
  }
  if (store.stop_plan() != plan) store.set_stop_plan(plan);
  return {.file = database, .store = std::move(store), .definition = campaign};
}

}  // namespace proofmass::coordinator
