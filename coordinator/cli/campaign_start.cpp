#include "coordinator/cli/campaign_start.hpp"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/cli/exit_code.hpp"
#include "core/simulation/run.hpp"

namespace proofmass::coordinator {
namespace {

void require_same(const Store& store, const Campaign& wanted, const std::filesystem::path& database,
                  std::string_view remedy) {
  std::vector<std::string> differences = definition_differences(stored_campaign(store), wanted);
  if (store.model_version() != model_version) {
    differences.push_back(fmt::format("model: {} in the database, {} in this program",
                                      store.model_version(), model_version));
  }
  if (differences.empty()) return;
  std::string text = fmt::format("{} holds another campaign:", database.string());
  for (const std::string& difference : differences) text += "\n  " + difference;
  throw UsageError(fmt::format("{}\n{}", text, remedy));
}

}  // namespace

Campaign stored_campaign(const Store& store) {
  std::vector<std::vector<double>> columns;
  for (std::size_t element = 0; element < num_drawn; ++element) {
    const std::array elements{element};
    std::vector<double> column = std::move(store.table_columns(elements).front());
    if (!column.empty()) columns.push_back(std::move(column));
  }
  return parse_stored_campaign(store.definition(), store.environment_table(), std::move(columns));
}

void extend_to(Store& store, const Campaign& wanted, const std::filesystem::path& database,
               std::string_view remedy) {
  require_same(store, wanted, database, remedy);
  const std::uint64_t num_runs = store.num_runs();
  if (wanted.num_runs < num_runs) {
    throw UsageError(
        fmt::format("runs = {} (must be at least {}, the number that {} was asked for)",
                    wanted.num_runs, num_runs, database.string()));
  }
  if (wanted.num_runs > num_runs) store.extend(wanted, canonical_definition(wanted));
}

Store open_or_create(const Campaign& wanted, const std::filesystem::path& database,
                     std::string_view remedy) {
  if (!std::filesystem::exists(database)) {
    return Store::create(database, wanted, canonical_definition(wanted));
  }
  Store store = Store::open(database);
  extend_to(store, wanted, database, remedy);
  return store;
}

}  // namespace proofmass::coordinator
