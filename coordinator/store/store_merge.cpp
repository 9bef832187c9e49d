// Several campaign databases of one campaign become one.

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

using detail::Database;
using detail::Statement;
using detail::Transaction;

namespace {

// Everything but the results. The first part that has a run gives its delivery. Workers are those
// of other parts if their sessions are, or get the next keys. One that is still there, as far as
// its part knows, is nobody that the whole waits for. min() of a NULL is NULL: what one part does
// not know of the runs that were fixed, the whole does not.
constexpr const char* add_other_rows_sql = R"(
CREATE TEMP TABLE worker_of (part_key INTEGER PRIMARY KEY, worker_key INTEGER NOT NULL);
INSERT INTO worker_of
SELECT p.worker_key,
       ifnull(w.worker_key, (SELECT ifnull(max(worker_key), 0) FROM main.worker) +
                            row_number() OVER (PARTITION BY w.worker_key IS NULL
                                               ORDER BY p.worker_key))
FROM part.worker AS p LEFT JOIN main.worker AS w ON w.session = p.session;
INSERT INTO main.worker (worker_key, session, worker, host, process_id, num_slots, first_seen_utc,
                         ended_utc, end_reason, cards)
SELECT w.worker_key, session, worker, host, process_id, num_slots, first_seen_utc,
       ifnull(ended_utc, strftime('%Y-%m-%dT%H:%M:%SZ', 'now')), ifnull(end_reason, 'silent'), cards
FROM part.worker AS p JOIN worker_of AS w ON w.part_key = p.worker_key
WHERE TRUE ON CONFLICT (worker_key) DO NOTHING;
INSERT INTO main.delivery
SELECT run_index, (SELECT w.worker_key FROM worker_of AS w WHERE part_key = p.worker_key), attempt,
       compute_s, received_unix_s
FROM part.delivery AS p WHERE TRUE ON CONFLICT DO NOTHING;
INSERT INTO main.attempt (first_run, num_runs, attempt, worker_key, reason, is_blamed, lost_unix_s)
SELECT first_run, num_runs, attempt,
       (SELECT w.worker_key FROM worker_of AS w WHERE part_key = p.worker_key), reason, is_blamed,
       lost_unix_s
FROM part.attempt AS p ORDER BY attempt_id;
INSERT INTO main.run_failure SELECT * FROM part.run_failure WHERE TRUE ON CONFLICT DO NOTHING;
INSERT INTO main.audit
SELECT run_index, (SELECT w.worker_key FROM worker_of AS w WHERE part_key = p.worker_key), is_equal,
       stored_digest, second_digest, compared_unix_s
FROM part.audit AS p WHERE TRUE ON CONFLICT DO NOTHING;
UPDATE main.campaign
SET num_runs_fixed = min(num_runs_fixed, (SELECT p.num_runs_fixed FROM part.campaign AS p));
DROP TABLE worker_of;
)";

// What follows from the rows. A database that is merged may hold losses that another one of the
// parts holds as well.
constexpr const char* finish_sql = R"(
UPDATE worker SET num_results = counted.num_results, compute_s = counted.compute_s,
                  last_result_unix_s = counted.last_unix_s
FROM (SELECT worker_key, count(*) AS num_results, sum(compute_s) AS compute_s,
             max(received_unix_s) AS last_unix_s FROM delivery GROUP BY worker_key) AS counted
WHERE worker.worker_key = counted.worker_key;
DELETE FROM run_failure WHERE run_index IN (SELECT run_index FROM run_result);
DELETE FROM attempt WHERE attempt_id NOT IN
  (SELECT min(attempt_id) FROM attempt
   GROUP BY first_run, num_runs, attempt, worker_key, reason, is_blamed, lost_unix_s);
DELETE FROM attempt WHERE attempt_id NOT IN
  (SELECT attempt_id FROM attempt ORDER BY attempt_id DESC LIMIT {});
UPDATE campaign
SET phase = iif((SELECT count(*) FROM delivery) = num_runs, 'finished', 'active');
)";

/// All columns of run_result but those that are computed when read.
std::string result_columns(const Database& whole, std::string_view prefix) {
  return whole.text(fmt::format(
      "SELECT group_concat('{}' || name, ', ') FROM pragma_table_info('run_result')", prefix));
}

/// Joins the results of a part, which is attached to the whole as `part`.
/// @throws StoreError naming the run, if it has another result in a part before this one.
MergedPart add_results(const Database& whole, const Database& part) {
  Statement other = whole.prepare(fmt::format(
      "SELECT run_index FROM part.run_result AS p JOIN main.run_result AS w USING (run_index)"
      " WHERE ({}) IS NOT ({}) ORDER BY run_index LIMIT 1",
      result_columns(whole, "p."), result_columns(whole, "w.")));
  if (other.step()) {
    part.refuse(
        fmt::format("has another result of run {} than a part before it; one of them was "
                    "computed wrongly or changed, and `proofmass verify` with --fraction "
                    "tells which",
                    other.count(0)));
  }
  whole
      .prepare(fmt::format("INSERT INTO main.run_result ({0}) SELECT {0} FROM part.run_result"
                           " WHERE TRUE ON CONFLICT DO NOTHING",
                           result_columns(whole, "")))
      .run();
  const auto num_new = static_cast<std::uint64_t>(whole.num_changes());
  return {.num_new = num_new,
          .num_again = whole.count("SELECT count(*) FROM part.run_result") - num_new};
}

/// @throws StoreError if a result lacks its delivery, or breaks the rules of Store::write().
void add_largest_errors(const Database& whole, const ResultSchema& schema) {
  const std::uint64_t num_runs = whole.count("SELECT num_runs FROM campaign");
  detail::LargestErrorRows largest(whole, schema);
  Statement delivery =
      whole.prepare("SELECT run_index, compute_s FROM delivery ORDER BY run_index");
  ResultReader results(whole, schema);
  while (const std::optional<RunResult> result = results.next()) {
    if (!delivery.step() || delivery.count(0) != result->run.value) {
      whole.refuse_as_damaged(
          fmt::format("delivery lacks run {}, which has a result", result->run.value));
    }
    detail::check_delivery(
        {.result = *result, .worker = {}, .attempt = {}, .compute_s = delivery.real(1)}, schema,
        num_runs);
    largest.add(*result);
  }
}

}  // namespace

Store Store::merge(const std::filesystem::path& path, const Campaign& campaign,
                   std::string_view definition, std::span<const std::filesystem::path> parts,
                   const std::function<void(const MergedPart&)>& on_part) {
  return create_filled(path, campaign, definition, [&](Database& whole) {
    for (const std::filesystem::path& file : parts) {
      const Store part = open_read_only(file);
      whole.attach(part.impl_->database, "part");
      Transaction transaction(whole);
      const MergedPart merged = add_results(whole, part.impl_->database);
      whole.execute(add_other_rows_sql);
      transaction.commit();
      whole.execute("DETACH part");
      on_part(merged);
    }
    Transaction transaction(whole);
    add_largest_errors(whole, campaign.results());
    whole.execute(fmt::format(finish_sql, detail::num_attempts_max));
    detail::write_table_digest(whole, campaign.model());
    transaction.commit();
  });
}

}  // namespace proofmass::coordinator
