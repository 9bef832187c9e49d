#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// 16 hexadecimal digits: SQLite's integers have a sign.
[[nodiscard]] std::string hexadecimal(std::uint64_t value);

/// Rows of `worker` that are one worker's. All further workers share one more.
inline constexpr std::int64_t num_workers_max = 100'000;

/// Workers as rows of `worker`, which other tables refer to by key.
class WorkerRows {
 public:
  explicit WorkerRows(const Database& database);

  void write(const WorkerJoined& joined);
  void write(const WorkerEnded& ended);

  /// The key of a worker; one that never joined gets a row without a name. Further workers than
  /// num_workers_max have the key of the row `further workers`, which counts the results of all.
  [[nodiscard]] std::int64_t key_of(wire::SessionId session);

  /// Whether the row of further workers was made since the last call.
  [[nodiscard]] bool take_overflow() { return std::exchange(has_overflowed_, false); }

  /// Name of a worker, for people.
  [[nodiscard]] std::string name_of(wire::SessionId session);

  /// Counts a result of a worker; in the table after write_counts().
  void count_result(std::int64_t worker, double compute_s);
  /// @param now_unix_s  Stands for the time of all of them.
  void write_counts(std::int64_t now_unix_s);

 private:
  struct Count {
    std::int64_t num_results = 0;
    double compute_s = 0.0;
  };

  /// The key of a row that is there.
  [[nodiscard]] std::optional<std::int64_t> stored_key(wire::SessionId session);
  /// Keys are given in order and never given up.
  [[nodiscard]] bool is_full() const;
  [[nodiscard]] std::int64_t key_of_further();

  const Database& database_;
  Statement select_key_;
  std::map<wire::SessionId, std::int64_t> keys_;  ///< Of rows that are there.
  bool has_overflowed_ = false;
  std::map<std::int64_t, Count> counts_;
};

/// Rows of `attempt` that are kept.
inline constexpr std::int64_t num_attempts_max = 1'000'000;

/// Rows of `audit` that are kept beyond one for each run of the campaign. Further ones are kept
/// only if they differ, and then as many again.
inline constexpr std::uint64_t num_further_audits_max = 1'000'000;

/// Writes each kind of entry where it belongs. Holds prepared statements and the keys of workers:
/// to be thrown away with a transaction that is rolled back.
class EntryRows {
 public:
  /// @param results  Of the campaign; outlives the object.
  EntryRows(const Database& database, const ResultSchema& results);

  /// @pre Inside a transaction.
  CommitSummary write(std::span<const Entry> entries);

 private:
  void write_entry(const Delivery& delivery);
  void write_entry(const SecondDelivery& second);
  void write_entry(const ReturnedRuns& lost);
  void write_entry(const GivenUpRun& given_up);
  void write_entry(const RetriedRuns& retried);
  void write_entry(const EventEntry& event);
  void write_entry(const WorkerJoined& joined) { workers_.write(joined); }
  void write_entry(const WorkerEnded& ended) { workers_.write(ended); }
  void write_entry(const CampaignControl& control);

  void compare(const Delivery& delivery);
  /// A worker that has a delivery of the run in the file, or had: not a run that lacks one.
  void require_delivery(RunIndex run) const;
  /// Whether a comparison may get a row; says so once if not.
  [[nodiscard]] bool has_room_for_audit(RunIndex run, std::int64_t worker, bool is_equal);
  void report_contradiction(const Delivery& delivery);

  const Database& database_;
  ResultRows results_;
  LargestErrorRows largest_errors_;
  WorkerRows workers_;
  Statement insert_delivery_;
  Statement insert_audit_;
  Statement insert_attempt_;
  Statement trim_attempts_;
  Statement insert_event_;
  Statement trim_events_;
  std::int64_t now_unix_s_ = 0;
  bool has_failures_ = false;                ///< Of runs that are given up, which is rare.
  std::optional<std::uint64_t> num_audits_;  ///< Rows; counted when the first is written.
  bool is_audit_full_ = false;               ///< `audit_history_full` was written.
  CommitSummary summary_;
};

}  // namespace proofmass::coordinator::detail
