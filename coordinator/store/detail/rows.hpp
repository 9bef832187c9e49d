#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"

// What the tables of a campaign database hold, as values. Each table is written by the source of
// its name.

namespace proofmass::coordinator::detail {

/// Fills the tables `campaign`, `parameter`, those of the data that all runs share, and
/// `dispersion_value`.
void insert_campaign(Database& database, const Campaign& campaign, std::string_view definition);

/// Fills the tables `parameter` and `budget_coefficient`.
void insert_parameters(Database& database, const Campaign& campaign);

/// A whole number below 2⁶⁴ that is stored as text.
/// @param column  That it stands in, for messages.
/// @throws StoreError if the text is none.
[[nodiscard]] std::uint64_t number_in(const Database& database, std::string_view column,
                                      const std::string& text, int base);
[[nodiscard]] std::uint64_t read_seed(const Database& database);
/// The number of campaign.reference_digest; 0 if it is empty.
[[nodiscard]] std::uint64_t reference_digest_in(const Database& database, const std::string& text);

/// How the campaign is served: columns of `campaign`.
[[nodiscard]] CampaignControl read_control(const Database& database);
void write_control(const Database& database, const CampaignControl& control);

/// Where the columns of the values of a campaign stand in a row of `run_result`, from 0. Standard
/// errors and their fit are read by themselves: where there are none, reading them would cost a
/// tenth of all reading.
struct ResultColumns {
  explicit ResultColumns(const ResultSchema& results);

  const ResultSchema& schema;
  std::vector<ValueColumn> values;
  int num_quantities, num_standard_errors, num_fit;
  std::size_t num_correlations;
  int num_health;
  int truth, estimate, health, loss_cause, loss_session, num_all;
};

/// Whether a column has standard errors or their fit.
[[nodiscard]] inline bool is_of_standard_errors(const ValueColumn& column) {
  return column.kind == ValueKind::standard_error || column.kind == ValueKind::fit;
}

/// Results as rows of `run_result`; the columns follow from the ResultSchema of the campaign.
class ResultRows {
 public:
  /// @param results  Of the campaign; outlives the object.
  ResultRows(const Database& database, const ResultSchema& results);

  /// Stores a result unless the run has one; returns whether it did.
  [[nodiscard]] bool insert(const RunResult& result);

  /// The stored result. @pre There is one.
  [[nodiscard]] RunResult read(RunIndex run);

 private:
  const Database& database_;
  ResultColumns columns_;
  Statement insert_;
  Statement select_;
  std::optional<Statement> select_standard_errors_;  ///< None if the campaign has none.
};

/// Whether two results of one run agree in everything that means something.
[[nodiscard]] bool are_equal(const RunResult& left, const RunResult& right);

/// FNV-1a of everything in a result that means something, zeros without a sign: what people
/// compare.
[[nodiscard]] std::uint64_t digest(const RunResult& result);

/// Checks a delivery before it is stored.
/// @throws StoreError naming the field.
void check_delivery(const Delivery& delivery, const ResultSchema& results, std::uint64_t num_runs);

/// Replaces the rows of `budget_entry`; those after estimation are absent while no run has an
/// estimate. Leaves none without a budget.
void replace_budgets(Database& database, const std::optional<ErrorBudget>& budget,
                     const CampaignStatistics& statistics);

/// Runs that are kept for each parameter in `worst_run`.
inline constexpr std::size_t num_worst_runs = 10;

/// A run and its |error| of some parameter, SI.
struct RankedRun {
  double magnitude = 0.0;
  RunIndex run;

  bool operator==(const RankedRun&) const = default;
};

/// Takes a run into those with the largest |error| of one parameter, the largest first, if it is
/// one of num_worst_runs; of equal ones the first run counts as larger, in whatever order runs
/// come.
/// @return Whether it was.
bool offer(std::vector<RankedRun>& worst, const RankedRun& offered);

/// The worst runs of each parameter, by its index.
using WorstRunTable = std::vector<std::vector<RankedRun>>;

[[nodiscard]] WorstRunTable read_worst_runs(const Database& database, const ResultSchema& results);

/// Largest acceptable |error| of each parameter, SI; infinite if there is none.
[[nodiscard]] std::vector<double> read_objectives(const Database& database,
                                                  const ResultSchema& results);

/// Which parameters have an |error| above their objective: bit i for the one with index i.
[[nodiscard]] std::uint64_t exceeded_objectives(const RunResult& result,
                                                std::span<const double> objectives);

/// Keeps `overrun` and `worst_run` in step with `run_result`. Knows the rows that are there: to be
/// thrown away with a transaction that is rolled back.
class LargestErrorRows {
 public:
  /// @param results  Of the campaign; outlives the object.
  LargestErrorRows(const Database& database, const ResultSchema& results);

  /// @pre The result was stored just now, for the first time.
  void add(const RunResult& result);

 private:
  const ResultSchema& schema_;
  std::vector<double> objectives_;
  WorstRunTable worst_;
  Statement insert_overrun_;
  Statement insert_worst_;
  Statement trim_worst_;
};

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
  /// @return As Store::write().
  std::vector<Comparison> write(std::span<const Entry> entries);

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
  std::vector<Comparison> comparisons_;
};

/// SHA-256 of what defines a campaign, 64 hexadecimal digits: of the row of `campaign`, as text
/// (`NULL` without a value), name, seed, num_runs, definition, model_version, build, created_utc,
/// campaign_uid, owner, stop_rule, num_runs_max, failures_max and, if it is not NULL,
/// num_runs_fixed, which files of version 8 did not have, and, if it is not empty,
/// model_description; then of each table of
/// shared data the number of rows and, by `position`, position and numbers; then the number of rows
/// of `dispersion_value` and, by `quantity` and `run_index`, quantity, run and value. Integers have
/// 64 bits; layout as in Sha256.
[[nodiscard]] std::string compute_table_digest(const Database& database, const Model& model);

/// Stores the digest of all this as it is; to be called after every change of it. @pre Inside a
/// transaction.
void write_table_digest(const Database& database, const Model& model);

/// Checks everything that SQLite can check, and that the schema is that of a new file.
/// @throws StoreError naming the first finding.
void check_integrity(const Database& database, const StoredKind& kind);

}  // namespace proofmass::coordinator::detail
