// How the runs of a campaign were computed, from the rows of workers, deliveries and attempts.

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Database;
using detail::Statement;

std::vector<HostShare> read_hosts(const Database& database) {
  Statement rows = database.prepare(
      "SELECT host, count(*), sum(num_results), sum(compute_s) FROM worker GROUP BY host "
      "ORDER BY sum(num_results) DESC, host LIMIT 20");
  std::vector<HostShare> hosts;
  while (rows.step()) {
    hosts.push_back({.host = rows.text(0),
                     .num_workers = rows.count(1),
                     .num_results = rows.count(2),
                     .compute_s = rows.real(3)});
  }
  return hosts;
}

/// Reasons are words of this program; a file from elsewhere may have any number of others.
std::vector<LossShare> read_losses(const Database& database) {
  Statement rows = database.prepare(
      "SELECT reason, count(*), sum(num_runs), is_blamed FROM attempt GROUP BY reason, is_blamed "
      "ORDER BY sum(num_runs) DESC, reason, is_blamed LIMIT 20");
  std::vector<LossShare> losses;
  while (rows.step()) {
    losses.push_back({.reason = rows.text(0),
                      .num_losses = rows.count(1),
                      .num_runs = rows.count(2),
                      .is_blamed = rows.integer(3) != 0});
  }
  return losses;
}

std::optional<std::string> utc_of(const Database& database, std::string_view bound) {
  Statement row = database.prepare("SELECT strftime('%Y-%m-%dT%H:%M:%SZ', " + std::string(bound) +
                                   "(received_unix_s), 'unixepoch') FROM delivery");
  if (!row.step()) return std::nullopt;
  std::string text = row.text(0);
  if (text.empty()) return std::nullopt;
  return text;
}

}  // namespace

Execution Store::execution() const {
  const Database& database = impl_->database;
  Execution execution;
  execution.num_coordinators = database.count("SELECT count(*) FROM coordinator_start");
  execution.num_workers = database.count("SELECT count(*) FROM worker");
  execution.num_hosts = database.count("SELECT count(DISTINCT host) FROM worker");
  Statement total = database.prepare("SELECT total(compute_s) FROM worker");
  if (total.step()) execution.compute_s = total.real(0);
  execution.hosts = read_hosts(database);
  execution.losses = read_losses(database);
  execution.num_retried = database.count("SELECT count(*) FROM delivery WHERE attempt > 1");
  execution.num_audited = num_compared();
  execution.num_contradicting = database.count("SELECT count(*) FROM audit WHERE NOT is_equal");
  execution.first_result_utc = utc_of(database, "min");
  execution.last_result_utc = utc_of(database, "max");
  return execution;
}

}  // namespace proofmass::coordinator
