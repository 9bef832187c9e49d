#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

struct WriterConfig {
  std::size_t commit_runs_max = 256;  ///< Results for which a commit waits if more may come ...
  std::chrono::steady_clock::duration commit_after = std::chrono::milliseconds(50);  ///< ... or so.
  /// What nobody waits for, such as events and losses, causes a commit of its own after this time.
  std::chrono::steady_clock::duration record_after = std::chrono::seconds(1);
  std::chrono::steady_clock::duration retry_after = std::chrono::seconds(5);  ///< After a failure.
  /// How often files are looked at of which nothing is to be written: they may have lost their
  /// name.
  std::chrono::steady_clock::duration look_after = std::chrono::seconds(2);
  /// Entries other than results that wait for one file, at most; further ones are counted and
  /// dropped.
  std::size_t num_records_max = 100'000;
  /// Size of a file's write-ahead log above which an event says so. Some megabytes are usual.
  std::uint64_t log_size_max = std::uint64_t{64} << 20;
};

/// These results are durable. Each result that was delivered is named once.
struct Committed {
  wire::CampaignId campaign;
  std::vector<RunIndex> runs;
};

/// A second result was compared with the stored one.
struct Compared {
  wire::CampaignId campaign;
  Comparison comparison;
};

/// Nothing can be written to this file for now. All that was handed over is kept, and tried again
/// each `retry_after`; said once for each reason until StoreRecovered.
struct StoreFailed {
  wire::CampaignId campaign;
  std::string text;           ///< `campaign database = path (the disk is full; ...)`.
  bool is_abandoned = false;  ///< As Store::is_abandoned(): it will never be recovered.
};

/// All is well again, and what was waiting is written.
struct StoreRecovered {
  wire::CampaignId campaign;
};

/// Something to be logged about a file, said once until it is over; README.md (The writer) names
/// the events of a log that cannot be folded in.
struct FileEvent {
  wire::CampaignId campaign;
  wire::Event event;
};

using Completion = std::variant<Committed, Compared, StoreFailed, StoreRecovered, FileEvent>;

/// Writes to campaign databases, in a thread of its own: a service never waits for a disk.
///
/// What is handed over is written in that order, many entries in one durable transaction. The
/// functions may be called from any thread, and return at once unless they say otherwise. The
/// number of results that wait has no limit here: it is that of the runs that are lent.
class StoreWriter {
 public:
  /// @param wake  Called in the writer's thread when there are new completions. Must not throw.
  explicit StoreWriter(std::function<void()> wake, const WriterConfig& config = {});
  /// Writes what can be written at once, and closes all files. What cannot is lost; nobody was told
  /// that it is durable.
  ~StoreWriter();

  /// Takes over a file.
  /// @pre No campaign has this id.
  void open(wire::CampaignId campaign, Store store);
  /// Gives a file back; waits for one attempt to write what was handed over. What that could not
  /// write is dropped.
  Store close(wire::CampaignId campaign);
  /// Lets `action` use the file in the writer's thread, after all that was handed over before has
  /// been tried; waits for it, and throws what it throws. For what is rare: more runs, statistics.
  void access(wire::CampaignId campaign, const std::function<void(Store&)>& action);

  /// Stores an entry. A Delivery leads to Committed with its run; a SecondDelivery, of a run of
  /// which a result is stored or was handed over before, to Compared. A worker's WorkerJoined goes
  /// to the files of campaigns of which it was lent runs.
  /// @param campaign  0 for all files that are concerned: of a WorkerEnded those that have the
  /// worker
  ///                  without an end, of anything else those that are not at rest.
  void write(wire::CampaignId campaign, Entry entry);
  /// No more results will come soon: those that were delivered are committed at once.
  void hurry(wire::CampaignId campaign);

  /// Nothing more is expected for a file: once all that was handed over is written, the write-ahead
  /// log is folded in, so that a copy of the file alone is whole. Later entries are written as
  /// usual, and the log is folded in again after each, until a result is delivered.
  void rest(wire::CampaignId campaign);

  /// What happened since the last call, in order.
  [[nodiscard]] std::vector<Completion> take_completions();
  /// Waits until all that was handed over has been tried, also where the last attempt failed.
  void flush();

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// One campaign database. The writer's thread alone uses `store` and `writing`, without the lock.
  struct OpenFile {
    Store store;
    std::deque<Entry> waiting{};      // In the order in which it was handed over.
    std::size_t num_results = 0;      // Of them, those that a worker waits for.
    std::size_t num_records = 0;      // Of them, losses and events.
    std::uint64_t num_dropped = 0;    // Losses and events beyond `num_records_max`.
    std::vector<Entry> writing{};     // Taken from `waiting`; kept if the last attempt failed.
    std::optional<TimePoint> due{};   // When to write, to try again or to fold the log in.
    bool has_failed = false;          // The last attempt.
    std::string failure{};            // Why it did, as the log last said.
    bool has_large_log = false;       // As the log of the program last said.
    std::set<wire::SessionId> known;  // Workers of which the file has no end yet.
    bool is_rest_wanted = false;      // Nothing more is expected.
    bool is_fold_due = false;         // The log is to be folded in, once nothing waits.
    int num_folds_failed = 0;         // In a row: a reader keeps the log from that.

    [[nodiscard]] bool is_written_out() const { return writing.empty() && waiting.empty(); }
    /// Sets `due`, unless something sooner is.
    void be_due(TimePoint at) { due = std::min(at, due.value_or(at)); }
  };

  /// Something that the caller waits for, after all that was handed over for its file.
  struct Request {
    wire::CampaignId campaign;  // 0: all files.
    std::function<void()> action;
    std::promise<void> done;
  };

  /// What came of one attempt to write.
  struct Attempted {
    std::vector<Comparison> comparisons;
    std::optional<std::string> failure;
    std::uint64_t log_size = 0;  // Afterwards.
  };

  // Called by the service.
  OpenFile& file(wire::CampaignId campaign);
  [[nodiscard]] bool add(OpenFile& file, Entry entry);
  void change(const std::function<void()>& action);
  void wait_for(wire::CampaignId campaign, std::function<void()> action);

  // The thread.
  using Lock = std::unique_lock<std::mutex>;
  void run();
  void serve_request(Lock& lock);
  void write_due(Lock& lock);
  void look_at_all(Lock& lock);
  void write_all(wire::CampaignId campaign, Lock& lock);
  static void take(OpenFile& file, std::size_t num_max);
  void fold(wire::CampaignId campaign, Lock& lock);
  bool write_some(wire::CampaignId campaign, std::size_t num_max, Lock& lock);
  void finish_write(wire::CampaignId campaign, OpenFile& file, Attempted attempted);
  void watch_log(wire::CampaignId campaign, OpenFile& file, std::uint64_t log_size);
  [[nodiscard]] std::optional<TimePoint> next_due_time() const;
  [[nodiscard]] std::vector<wire::CampaignId> ids() const;
  [[nodiscard]] static Attempted try_to_write(OpenFile& file);

  const WriterConfig config_;
  const std::function<void()> wake_;

  std::mutex mutex_;  ///< Guards all that follows; see OpenFile for what it does not.
  std::condition_variable changed_;
  std::map<wire::CampaignId, OpenFile> files_;
  std::deque<Request> requests_;
  std::vector<Completion> completions_;
  bool is_ending_ = false;
  /// When to look at files of which nothing is to be written.
  TimePoint look_at_ = std::chrono::steady_clock::now() + config_.look_after;

  std::thread thread_;  ///< Begins when all else is there.
};

}  // namespace proofmass::coordinator
