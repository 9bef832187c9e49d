#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/detail/worker_rows.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// Rows of `attempt` that are kept.
inline constexpr std::int64_t num_attempts_max = 1'000'000;

/// Rows of `audit` that are kept beyond one for each run of the campaign. Further ones are kept
/// only if they differ, and then as many again.
inline constexpr std::uint64_t num_further_audits_max = 1'000'000;

/// Writes each kind of entry where it belongs. Holds prepared statements and the keys of workers:
/// to be thrown away with a transaction that is rolled back.
class EntryRows {
 public:
  explicit EntryRows(const Database& database);

  /// @pre Inside a transaction.
  CommitSummary write(std::span<const Entry> entries);

 private:
  void write_entry(const Delivery& delivery);
  void write_entry(const SecondDelivery& second);
  void write_entry(const LostRuns& lost);
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
  Statement select_failures_;
  Statement delete_failure_;
  Statement insert_audit_;
  Statement insert_attempt_;
  Statement trim_attempts_;
  Statement insert_event_;
  Statement trim_events_;
  std::int64_t now_unix_s_ = 0;
  bool has_failures_ = false;                ///< Of runs that are given up, which is rare.
  std::optional<std::uint64_t> num_audits_;  ///< Rows; counted when the first is written.
  bool is_audit_full_ = false;               ///< As was said.
  CommitSummary summary_;
};

}  // namespace proofmass::coordinator::detail
