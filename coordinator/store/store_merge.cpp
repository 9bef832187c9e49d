// Several campaign databases of one campaign become one.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

using detail::Database;
using detail::LargestErrorRows;
using detail::ResultRows;
using detail::Statement;

namespace {

// A worker that is still there, as far as its part knows, is nobody that the whole waits for.
constexpr std::string_view insert_worker_sql =
    "INSERT INTO worker (session, worker, host, process_id, num_slots, first_seen_utc, ended_utc,"
    " end_reason, cards) VALUES (nullif(?1, ''), ?2, ?3, ?4, ?5, ?6,"
    " coalesce(nullif(?7, ''), strftime('%Y-%m-%dT%H:%M:%SZ', 'now')),"
    " coalesce(nullif(?8, ''), 'silent'), ?9)";

constexpr std::string_view count_deliveries_sql =
    "UPDATE worker SET num_results = counted.num_results, compute_s = counted.compute_s,"
    " last_result_unix_s = counted.last_unix_s FROM"
    " (SELECT worker_key, count(*) AS num_results, sum(compute_s) AS compute_s,"
    "  max(received_unix_s) AS last_unix_s FROM delivery GROUP BY worker_key) AS counted"
    " WHERE worker.worker_key = counted.worker_key";

// A database that is merged may hold what another one of the parts holds as well.
constexpr std::string_view delete_repeated_losses_sql =
    "DELETE FROM attempt WHERE attempt_id NOT IN (SELECT min(attempt_id) FROM attempt GROUP BY"
    " first_run, num_runs, attempt, worker_key, reason, is_blamed, lost_unix_s)";

constexpr std::string_view delete_old_losses_sql =
    "DELETE FROM attempt WHERE attempt_id NOT IN"
    " (SELECT attempt_id FROM attempt ORDER BY attempt_id DESC LIMIT ?)";

/// A table whose rows go into the whole as they are, but for the key of their worker.
struct MergedTable {
  std::string_view name;
  std::string_view columns;  ///< The first is worker_key, if the table has one.
  bool has_worker;
  std::string_view order;
};

constexpr std::array merged_tables{
    MergedTable{"attempt",
                "worker_key, first_run, num_runs, attempt, reason, is_blamed, lost_unix_s", true,
                "ORDER BY attempt_id"},
    MergedTable{"run_failure", "run_index, reason, num_attempts, given_up_utc", false, ""},
    MergedTable{"audit",
                "worker_key, run_index, is_equal, stored_digest, second_digest, compared_unix_s",
                true, ""}};

using WorkerKeys = std::map<std::int64_t, std::int64_t>;  // In the part → in the whole.

/// The key in the whole of a worker that a row of the part refers to.
std::int64_t key_of(const WorkerKeys& workers, const Statement& row, int column) {
  const auto found = workers.find(row.integer(column));
  if (found != workers.end()) return found->second;
  row.refuse_as_damaged(fmt::format("worker lacks worker_key = {}", row.integer(column)));
}

void copy_rows(const Database& part, const Database& whole, const MergedTable& table,
               const WorkerKeys& workers) {
  Statement row =
      part.prepare(fmt::format("SELECT {} FROM {} {}", table.columns, table.name, table.order));
  Statement insert =
      whole.prepare(fmt::format("INSERT INTO {} ({}) VALUES ({}) ON CONFLICT DO NOTHING",
                                table.name, table.columns, detail::places(row.num_columns())));
  while (row.step()) {
    for (int i = 0; i < row.num_columns(); ++i) insert.bind_cell(i + 1, row, i);
    if (table.has_worker) insert.bind(1, key_of(workers, row, 0));
    insert.finish();
  }
}

/// Joins what several campaign databases hold of the runs of one campaign: results with the
/// delivery that was kept, workers, losses, runs that were given up, comparisons. The first part
/// that has a run gives its delivery.
class MergeRows {
 public:
  /// @param whole   A new file of the campaign; outlives this object.
  /// @param schema  Of the campaign; outlives this object.
  MergeRows(Database& whole, const ResultSchema& schema)
      : whole_(whole),
        schema_(schema),
        num_runs_(whole.count("SELECT num_runs FROM campaign")),
        results_(whole, schema),
        largest_errors_(whole, schema) {}

  /// @pre Inside a transaction; the part has been checked.
  /// @throws StoreError naming the run, if it has another result in a part before this one, or if
  ///         a result breaks the rules of Store::write().
  [[nodiscard]] MergedPart add(const Database& part) {
    const WorkerKeys workers = add_workers(part);
    const MergedPart merged = add_results(part, workers);
    for (const MergedTable& table : merged_tables) copy_rows(part, whole_, table, workers);
    // min() of a NULL is NULL: what one part does not know, the whole does not.
    whole_.prepare("UPDATE campaign SET num_runs_fixed = min(num_runs_fixed, ?)")
        .run(detail::read_num_runs_fixed(part));
    return merged;
  }

  /// Writes what follows from the rows, and whether the campaign is finished. Called once, after
  /// the last part.
  void finish() {
    whole_.prepare(count_deliveries_sql).run();
    whole_.prepare("DELETE FROM run_failure WHERE run_index IN (SELECT run_index FROM run_result)")
        .run();
    whole_.prepare(delete_repeated_losses_sql).run();
    whole_.prepare(delete_old_losses_sql).run(detail::num_attempts_max);
    CampaignControl control = detail::read_control(whole_);
    const bool is_finished = whole_.count("SELECT count(*) FROM delivery") == num_runs_;
    control.phase = is_finished ? wire::CampaignPhase::finished : wire::CampaignPhase::active;
    detail::write_control(whole_, control);
  }

 private:
  WorkerKeys add_workers(const Database& part) {
    WorkerKeys keys;
    Statement select = part.prepare(
        "SELECT worker_key, ifnull(session, ''), worker, host, process_id, num_slots, "
        "first_seen_utc,"
        " ifnull(ended_utc, ''), ifnull(end_reason, ''), cards FROM worker ORDER BY worker_key");
    Statement find = whole_.prepare("SELECT worker_key FROM worker WHERE session = ?");
    Statement insert = whole_.prepare(insert_worker_sql);
    while (select.step()) {
      find.bind_all(select.text(1));
      if (find.step()) {
        keys.emplace(select.integer(0), find.integer(0));
        find.finish();
        continue;
      }
      insert.run(select.text(1), select.text(2), select.text(3), select.optional_count(4),
                 select.optional_count(5), select.text(6), select.text(7), select.text(8),
                 select.text(9));
      keys.emplace(select.integer(0), whole_.last_row());
    }
    return keys;
  }

  MergedPart add_results(const Database& part, const WorkerKeys& workers) {
    MergedPart merged;
    ResultReader results(part, schema_);
    Statement delivery = part.prepare(
        "SELECT run_index, worker_key, attempt, compute_s, received_unix_s FROM delivery"
        " ORDER BY run_index");
    Statement insert = whole_.prepare("INSERT INTO delivery VALUES (?, ?, ?, ?, ?)");
    while (const std::optional<RunResult> next = results.next()) {
      const RunResult& result = *next;
      if (!delivery.step() || delivery.count(0) != result.run.value) {
        part.refuse_as_damaged(
            fmt::format("delivery lacks run {}, which has a result", result.run.value));
      }
      detail::check_delivery(
          {.result = result, .worker = {}, .attempt = {}, .compute_s = delivery.real(3)}, schema_,
          num_runs_);
      if (results_.insert(result)) {
        insert.run(result.run.value, key_of(workers, delivery, 1), delivery.count(2),
                   delivery.real(3), delivery.integer(4));
        largest_errors_.add(result);
        ++merged.num_new;
        continue;
      }
      ++merged.num_again;
      if (detail::are_equal(result, results_.read(result.run))) continue;
      part.refuse(
          fmt::format("has another result of run {} than a part before it; one of them was "
                      "computed wrongly or changed, and `proofmass verify` with --fraction "
                      "tells which",
                      result.run.value));
    }
    return merged;
  }

  Database& whole_;
  const ResultSchema& schema_;
  std::uint64_t num_runs_;
  ResultRows results_;
  LargestErrorRows largest_errors_;
};

}  // namespace

Store Store::merge(const std::filesystem::path& path, const Campaign& campaign,
                   std::string_view definition, std::span<const std::filesystem::path> parts,
                   const std::function<void(const MergedPart&)>& on_part) {
  return create_filled(path, campaign, definition, [&](Database& whole) {
    const ResultSchema schema = campaign.results();
    MergeRows rows(whole, schema);
    for (const std::filesystem::path& file : parts) {
      const Store part = open_read_only(file);
      part.read_one_state([&] { on_part(rows.add(part.impl_->database)); });
    }
    rows.finish();
    detail::write_table_digest(whole, campaign.model());
  });
}

}  // namespace proofmass::coordinator
