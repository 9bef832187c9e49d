#include "coordinator/store/detail/schema.hpp"

#include <fmt/format.h>

#include <map>
#include <string>

#include "coordinator/store/store_error.hpp"
#include "proto/link/kill_point.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// Definitions by kind and name: `view budget`.
std::map<std::string, std::string> schema_objects(const Database& database) {
  Statement select =
      database.prepare("SELECT type || ' ' || name, coalesce(sql, '') FROM sqlite_schema");
  std::map<std::string, std::string> objects;
  while (select.step()) objects.emplace(select.text(0), select.text(1));
  return objects;
}

// Counting the rows of a table reads every page of its tree, and SQLite checks each that it reads.
void check_pages(const Database& database) {
  Statement select = database.prepare(
      "SELECT 'SELECT count(*) FROM \"' || replace(name, '\"', '\"\"') || '\" NOT INDEXED'"
      " FROM sqlite_schema WHERE type = 'table' AND rootpage > 0");
  while (select.step()) database.prepare(select.text(0)).finish();
}

}  // namespace

std::int64_t schema_version() { return static_cast<std::int64_t>(migrations().size()); }

void check_campaign_file(const Database& database, const std::filesystem::path& path) {
  const std::int64_t id = database.integer("PRAGMA application_id");
  if (id != application_id) {
    throw StoreError(fmt::format(
        "campaign file = {} (is not a Proofmass campaign: its application_id is {}, not {})",
        path.string(), id, application_id));
  }
  const std::int64_t version = database.integer("PRAGMA user_version");
  if (version > schema_version()) {
    throw StoreError(
        fmt::format("campaign file = {} (is newer than this program: its user_version "
                    "is {}, the newest known one {})",
                    path.string(), version, schema_version()));
  }
  if (database.integer("SELECT count(*) FROM sqlite_schema WHERE type = 'trigger'") > 0) {
    database.refuse("has triggers, which a campaign has none of");
  }
  check_pages(database);
  const std::int64_t num_campaigns = database.integer("SELECT count(*) FROM campaign");
  if (num_campaigns != 1) database.refuse_as_damaged(fmt::format("campaigns = {}", num_campaigns));
}

void check_after_unclean_end(const Database& database) {
  if (database.text("PRAGMA journal_mode") != "wal") return;
  const std::string finding = database.text("PRAGMA quick_check(1)");
  if (finding == "ok") return;
  database.refuse_as_damaged(finding);
}

void check_results(const Database& database) {
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  const std::uint64_t end = database.count("SELECT ifnull(max(run_index) + 1, 0) FROM run_result");
  if (end > num_runs) {
    database.refuse_as_damaged(fmt::format("result of run {}, of {} there are", end - 1, num_runs));
  }
  const std::uint64_t num_results = database.count("SELECT count(*) FROM run_result");
  const std::uint64_t num_deliveries = database.count("SELECT count(*) FROM delivery");
  if (num_results == num_deliveries) return;
  database.refuse_as_damaged(
      fmt::format("results = {}, deliveries = {}", num_results, num_deliveries));
}

void check_up_to_date(const Database& database, const std::filesystem::path& path) {
  const std::int64_t version = database.integer("PRAGMA user_version");
  if (version == schema_version()) return;
  throw StoreError(
      fmt::format("campaign file = {} (is older than this program: its user_version is "
                  "{}, not {}; resuming the campaign brings it up to date)",
                  path.string(), version, schema_version()));
}

void check_schema(const Database& database) {
  Database fresh("new campaign", Access::memory);
  {
    Transaction transaction(fresh);
    migrate(fresh);
    transaction.commit();
  }
  std::map<std::string, std::string> expected = schema_objects(fresh);
  for (const auto& [name, sql] : schema_objects(database)) {
    const auto found = expected.find(name);
    if (found == expected.end()) database.refuse("has what is no part of a campaign: " + name);
    if (found->second != sql) database.refuse("has another definition of " + name);
    expected.erase(found);
  }
  if (!expected.empty()) database.refuse("lacks " + expected.begin()->first);
}

void migrate(Database& database) {
  PROOFMASS_EXPECT(database.in_transaction());
  for (std::int64_t version = database.integer("PRAGMA user_version"); version < schema_version();
       ++version) {
    database.execute(std::string(migrations()[static_cast<std::size_t>(version)]));
    PROOFMASS_EXPECT(database.integer("PRAGMA user_version") == version + 1);
    wire::kill_point(wire::KillPoint::while_migrating);
  }
}

}  // namespace proofmass::coordinator::detail
