#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"
#include "core/runs.hpp"
#include "core/statistics/stop_rule.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass {
class Model;  // Those who ask it include core/model.hpp.
}  // namespace proofmass

namespace proofmass::coordinator::detail {
class Database;
}  // namespace proofmass::coordinator::detail

namespace proofmass::coordinator {

struct CampaignRecord;

/// Results of a campaign database, one after the other, of one state of the file. The Store that
/// made it outlives it.
class ResultReader {
 public:
  /// @param schema  Of the file; outlives the reader.
  /// @param runs    Whose results are read; all if empty. Where a damaged file has them in another
  ///                order, some of a range are missed.
  ResultReader(const detail::Database& database, const ResultSchema& schema,
               std::optional<RunRange> runs = std::nullopt);
  ~ResultReader();
  ResultReader(ResultReader&&) noexcept;
  ResultReader& operator=(ResultReader&&) noexcept;

  /// The next one; empty after the last. Runs are strictly ascending and below the number of runs
  /// of the campaign, and counts and numbers are what their status says.
  /// @throws StoreError `is damaged: ...` if the file has another one.
  [[nodiscard]] std::optional<RunResult> next();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A campaign database: one SQLite database with everything about one campaign (see README.md).
///
/// What a function has stored when it returns survives a crash of the process and of the machine;
/// what a function has not stored when it throws is not in the file in part either. For one thread.
/// All functions throw StoreError if the file cannot be read or written.
class Store {
 public:
  /// Makes a new campaign database, complete or not at all, and opens it like open().
  ///
  /// @param campaign      Validated.
  /// @param definition    The campaign as canonical TOML, for those who open the file.
  /// @throws StoreError if the file exists; as write() does.
  static Store create(const std::filesystem::path& path, const Campaign& campaign,
                      std::string_view definition);

  /// create() of a campaign whose results exist.
  ///
  /// @param is_number_fixed  Whether the number of runs was before the first result.
  /// @param next_entries     Asked, until it has none, for what the file holds, as of write().
  static Store create_with_results(const std::filesystem::path& path, const Campaign& campaign,
                                   std::string_view definition, bool is_number_fixed,
                                   const std::function<std::vector<Entry>()>& next_entries);

  /// Makes a new campaign database of all that several databases of the campaign hold of its runs,
  /// complete or not at all, and opens it like open(). Events stay where they are.
  /// The campaign is finished if every run is, and else active.
  ///
  /// @param campaign, definition  As of create().
  /// @param parts                 Of the campaign; the caller has checked them with verify().
  /// @param on_part               Told of each part in turn; if it throws, no file is made.
  /// @throws StoreError if the file exists, if two parts have different results of a run, and as
  ///         open_read_only() does.
  static Store merge(const std::filesystem::path& path, const Campaign& campaign,
                     std::string_view definition, std::span<const std::filesystem::path> parts,
                     const std::function<void(const MergedPart&)>& on_part);

  /// Opens a campaign database for its coordinator: takes the lock, brings an older file up to
  /// date.
  /// @throws StoreError if the file is missing, foreign, newer than this program or damaged, or of
  ///         a model that the program does not know and the file does not describe; if another
  ///         coordinator has it; on a network file system; if it has another hard link.
  ///         A file without the log that it needs is opened as it is: runs whose results were in
  ///         it are missing, and are computed again. The event `log_lost` says so.
  static Store open(const std::filesystem::path& path);

  /// Opens a campaign database for reading, also while a coordinator writes to it. Of a file that
  /// is older than this program a private copy is read, as the file was when it was opened and
  /// brought up to date; the file stays as it is.
  /// @throws StoreError as open() does, but for lock, file system and hard links; if the file lacks
  ///         the log that it needs; if there is no room for the copy of an older file.
  static Store open_read_only(const std::filesystem::path& path);

  /// For a program that gives a finished campaign database a name that is new.
  /// @throws StoreError if a file has it, or if the log or the journal of one that is gone lies
  ///         beside it: SQLite would apply that to whatever gets the name.
  static void check_absence(const std::filesystem::path& path);

  /// Closes the file, after check_place(). Of a coordinator's, no other file (log, lock) remains
  /// unless somebody reads.
  ~Store();
  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;

  /// What a few rows tell: all but the file, the stamp and the numbers of runs with a result.
  [[nodiscard]] CampaignRecord record() const;
  /// A random number since the file was made; not 0, and below 2⁶³.
  [[nodiscard]] wire::CampaignId id() const;
  [[nodiscard]] std::string name() const;
  [[nodiscard]] std::uint64_t seed() const;
  [[nodiscard]] std::uint64_t num_runs() const;  ///< Runs wanted, finished or not.
  /// Runs that were asked for before the first result was there; see decide(). Empty if an older
  /// program began the campaign, or if it began with a stop rule.
  [[nodiscard]] std::optional<std::uint64_t> num_runs_fixed() const;
  [[nodiscard]] std::string definition() const;
  /// The model of the campaign: this program's if it is that one, or else what the file says of it,
  /// which computes no runs. It lives as long as the program.
  [[nodiscard]] const Model& model() const;
  /// What the results in the file are: those of its definition, as the model that began the
  /// campaign recorded them. It lives as long as the Store.
  [[nodiscard]] const ResultSchema& schema() const;
  [[nodiscard]] std::string model_version() const;  ///< Of the program that made the file.
  /// Model::reference_digest() where the campaign began; 0 if the model has no description, or an
  /// older program began it.
  [[nodiscard]] std::uint64_t reference_digest() const;
  /// The same, to be compared with that of a model, see wire::current_reference_digest().
  [[nodiscard]] std::uint64_t reference_digest_for(const Model& model) const;
  [[nodiscard]] std::string build() const;        ///< Of the program that made the file.
  [[nodiscard]] std::string created_utc() const;  ///< As in `2024-02-29T12:00:10.250Z`.
  /// Name of the key that submitted the campaign; empty without keys, or if it was not submitted.
  [[nodiscard]] std::string owner() const;
  void set_owner(std::string_view owner);
  /// SHA-256 (64 hexadecimal digits) of data tables and table values, as it was stored with
  /// them.
  [[nodiscard]] std::string table_digest() const;
  /// The digest of what the tables hold now; it differs if a number in them has changed.
  [[nodiscard]] std::string computed_table_digest() const;
  /// The campaign of the definition, which may have been changed: see stored_campaign().
  /// @throws DefinitionError if it is none, or another one's.
  [[nodiscard]] std::shared_ptr<const Campaign> campaign() const;

  /// Raises the number of runs; takes the table values of the new ones.
  /// @pre It is the campaign of the file: the caller has compared them.
  /// @throws StoreError if the file has more runs.
  void extend(const Campaign& campaign, std::string_view definition);

  [[nodiscard]] CampaignControl control() const;

  [[nodiscard]] StopPlan stop_plan() const;
  /// Under another plan with a rule, a finished campaign is active until the rule is checked.
  void set_stop_plan(const StopPlan& plan);
  /// Keeps what came of evaluating a stop rule; replaces what is there of these runs.
  /// @param statistic  Of the rule: `std(gain)`.
  void record_stop_check(std::uint64_t num_runs, std::string_view statistic,
                         const StopCheck& check);
  /// By statistic, each by the number of its runs.
  [[nodiscard]] std::vector<StopCheckRow> stop_checks() const;
  /// Finished runs that are not completed.
  [[nodiscard]] std::uint64_t num_without_estimate() const;

  /// How the runs were computed. Takes 0.1 s for a million runs.
  [[nodiscard]] CampaignExecution execution() const;
  /// Losses by reason, the one with the most runs first.
  [[nodiscard]] std::vector<LossCount> losses() const;

  /// The newest `count_max` events after the one with this id, in order.
  [[nodiscard]] std::vector<StoredEvent> events_after(std::uint64_t id,
                                                      std::size_t count_max) const;
  /// The ways in which finished runs ended without an estimate that converged, the most frequent
  /// first.
  [[nodiscard]] std::vector<EndCount> ends_without_estimate() const;
  /// The first `count_max` runs that were given up.
  [[nodiscard]] std::vector<GivenUpRecord> given_up_records(std::size_t count_max) const;
  /// @param num_runs_max    How many of the newest delivered runs are looked at.
  /// @param num_losses_max  How many of the newest losses are looked at.
  [[nodiscard]] RecentAttempts recent_attempts(std::size_t num_runs_max,
                                               std::size_t num_losses_max) const;

  /// Ascending; neighbours are one range.
  [[nodiscard]] std::vector<RunRange> finished_runs() const;
  [[nodiscard]] std::vector<RunRange> given_up_runs() const;  ///< Ascending; none is finished.
  /// Finished runs of which a second result was compared with the stored one, ascending.
  [[nodiscard]] std::vector<RunRange> compared_runs() const;
  /// Runs that are neither finished nor given up, ascending.
  [[nodiscard]] std::vector<BlamedRun> blamed_runs() const;

  /// Runs [0, n) with the largest n of which no loss was blamed on any: none was ever given up.
  [[nodiscard]] std::uint64_t num_before_blame() const;
  /// Second results that were compared with the stored ones.
  [[nodiscard]] std::uint64_t num_compared() const;
  [[nodiscard]] std::uint64_t num_contradicting() const;  ///< Those that differed.
  /// Second results that differ from the stored ones, in run order.
  [[nodiscard]] std::vector<Contradiction> contradictions() const;

  /// Workers that joined and have not ended, as far as the file knows: those that may come back
  /// after the coordinator before this one was killed.
  [[nodiscard]] std::vector<wire::SessionId> attached_sessions() const;
  void begin_coordinator(const CoordinatorStart& start);
  /// Writes down that this coordinator ended in order.
  void end_coordinator(wire::Epoch epoch);

  /// Writes all entries in order, or, if it throws, none. A run is stored once: a second delivery
  /// is only compared.
  /// @return What came of each delivery of a run that was there, and of each SecondDelivery.
  /// @throws StoreError if a delivery's run is not one of the campaign's or a number that matters
  /// is not finite.
  std::vector<Comparison> write(std::span<const Entry> entries);

  /// To be called when nothing more is expected: folds the write-ahead log into the file, which is
  /// whole without it until the next change. Waits for nobody.
  /// @return Why the log is still needed: somebody reads an old state of the file, or writes to it.
  ///         Empty if the log is folded in.
  /// @throws StoreError as check_place() does; if the disk does not take it. What was stored
  ///         is in the file and its log then.
  std::optional<std::string> rest();

  /// Looks whether the file that is open still has its name, its log and its length: otherwise
  /// nobody finds what is stored in it, and it ends with the process. Everything that stores
  /// something looks before and afterwards. Costs some looks at the directory.
  ///
  /// A file to which something happened is abandoned, also if somebody puts it back: nothing
  /// more is stored in it. A copy of all that is stored is made beside its name,
  /// `NAME.recovered-TIME.db`, unless it was truncated, when there is nothing to copy.
  /// @throws StoreError if something happened: what, where the copy is, and how to go on from it;
  ///         or why there is no copy yet, which the next call tries again to make.
  void check_place();
  /// Whether nothing can be stored any more, as check_place() said, and nothing is left to try.
  [[nodiscard]] bool is_abandoned() const;

  std::vector<Comparison> commit(std::span<const Delivery> deliveries);

  /// Calls visit(result) for each finished run, in strictly ascending order. Zeros have no sign.
  /// @throws StoreError as ResultReader::next() does.
  void for_each_result(const std::function<void(const RunResult&)>& visit) const;
  /// Calls visit(estimate − truth) of a quantity for each completed run below `num_runs`, in run
  /// order: some five times as fast as reading whole results.
  /// @pre All results were read in the same state of the file, and are in range.
  void for_each_error(std::size_t quantity, std::uint64_t num_runs,
                      const std::function<void(double)>& visit) const;
  /// Reads the finished runs one by one.
  [[nodiscard]] ResultReader results() const;
  [[nodiscard]] ResultReader results(RunRange runs) const;  ///< Of some of the runs.

  /// Replaces the stored statistics and budgets, and the summary of what they were computed from.
  /// @param budget    Of the campaign.
  /// @param digests   Of the results that the statistics were computed from.
  /// @param warnings  Of these results; rows of `run_warning`.
  void write_statistics(const CampaignStatistics& statistics,
                        const std::optional<ErrorBudget>& budget, const ResultDigests& digests,
                        std::span<const RunWarning> warnings = {});

  /// The summary of the last write_statistics(); empty before the first.
  [[nodiscard]] std::optional<Summary> summary() const;

  /// What `parameter` and `budget_coefficient` have other than a new file of a campaign of this
  /// definition, a line each: `parameter.unit of gain = m (must be 1)`. Numbers are equal if
  /// their bits are.
  [[nodiscard]] std::vector<std::string> parameter_differences(const Campaign& campaign) const;
  /// What `summary`, `statistic`, `budget_entry` and `run_warning` have other than
  /// write_statistics() would store, a line each; only the first two in a file of another model,
  /// whose rules the others follow, or one that was made before there were the others.
  /// @param summary  As it is stored; its digests and the runs that are given up are not compared.
  [[nodiscard]] std::vector<std::string> statistic_differences(
      const CampaignStatistics& statistics, const std::optional<ErrorBudget>& budget,
      std::span<const RunWarning> warnings, const std::optional<Summary>& summary) const;
  /// What rows of `stop_check` have other than these; there may be more of them.
  [[nodiscard]] std::vector<std::string> stop_check_differences(
      std::span<const StopCheckRow> expected) const;
  /// True if statistics are there: a summary was written with them.
  [[nodiscard]] bool has_statistics() const;
  /// @throws StoreError `campaign database = path (is damaged: what; restore it from a copy)`.
  [[noreturn]] void refuse_as_damaged(std::string_view what) const;

  /// Appends to the campaign's log, of which the newest 10,000 entries are kept.
  void record_event(std::string_view kind, std::string_view text);

  /// Lets `read` see one state of the file, whatever a coordinator writes meanwhile.
  void read_one_state(const std::function<void()>& read) const;

  /// Bytes of the write-ahead log, which only grows while somebody reads one state of the file.
  [[nodiscard]] std::uint64_t log_size() const;

  /// Checks every page, row, index and reference, that the schema is that of a new file, and that
  /// what is kept of results and deliveries follows from them (`overrun`, `worst_run`, counts of
  /// `worker`, digests of `audit`). Takes some 2 s for a million runs.
  /// @throws StoreError naming the first finding.
  void check_integrity() const;

  /// Copies the file as it is now, complete or not at all, also while a coordinator writes to it.
  /// The copy is one file, readable on read-only media.
  /// @param on_part  Called before each 16 MB or so; if it throws, no file is made.
  /// @throws StoreError if the destination exists or cannot be written, or if `on_part` throws.
  void back_up(
      const std::filesystem::path& destination, const std::function<void()>& on_part = [] {}) const;

  /// Writes the same tables and views into an empty file, for SQLite from 3.25 on: no table is
  /// STRICT, and columns that are computed when read hold their values. The programs themselves do
  /// not take it for a campaign.
  /// @throws StoreError if that cannot be done.
  void write_plain(const std::filesystem::path& draft) const;

 private:
  struct Impl;
  explicit Store(std::unique_ptr<Impl> impl);

  /// create(), with what `fill` writes beside the campaign.
  static Store create_filled(const std::filesystem::path& path, const Campaign& campaign,
                             std::string_view definition,
                             const std::function<void(detail::Database&)>& fill);

  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
