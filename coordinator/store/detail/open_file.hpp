#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/store/store_writer.hpp"

namespace proofmass::coordinator::detail {

using TimePoint = std::chrono::steady_clock::time_point;

/// Whether a worker waits for its acknowledgement.
[[nodiscard]] bool is_result(const Entry& entry);

/// What waits to be written to one campaign database, in the order in which it was handed over.
class WaitingEntries {
 public:
  /// @param num_records_max  Losses and events beyond this many are counted and dropped.
  explicit WaitingEntries(std::size_t num_records_max) : num_records_max_(num_records_max) {}

  void add(Entry entry, TimePoint now);

  /// No more results will come soon: those that wait need not wait for others.
  void hurry() { is_hurried_ = num_results_ > 0; }

  /// Moves up to `num_max` entries to the end of `entries`, and what was dropped as an event.
  void take(std::size_t num_max, std::vector<Entry>& entries, TimePoint now);

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] std::size_t num_results() const { return num_results_; }
  [[nodiscard]] bool is_hurried() const { return is_hurried_; }
  /// Since when the oldest one waits, roughly; nothing if none does.
  [[nodiscard]] std::optional<TimePoint> waiting_since() const { return waiting_since_; }
  /// Since when the oldest urgent entry waits: a result, or how the campaign is to be served.
  [[nodiscard]] std::optional<TimePoint> urgent_since() const { return urgent_since_; }

 private:
  std::size_t num_records_max_;
  std::deque<Entry> entries_;
  std::size_t num_results_ = 0;  ///< Of the entries, those that a worker waits for.
  bool is_hurried_ = false;
  std::size_t num_urgent_ = 0;   ///< Those, and how the campaign is to be served.
  std::size_t num_records_ = 0;  ///< Losses and events among them.
  std::uint64_t num_dropped_ = 0;
  std::optional<TimePoint> waiting_since_;
  std::optional<TimePoint> urgent_since_;
};

/// One campaign database of a StoreWriter. The writer's thread alone uses `store` and `writing`,
/// without the writer's lock.
struct OpenFile {
  Store store;
  WaitingEntries waiting;
  std::vector<Entry> writing;         ///< Taken from `waiting`; kept if the last attempt failed.
  std::optional<TimePoint> retry_at;  ///< If the last attempt failed.
  std::string failure;                ///< Why the last attempt failed, as the log last said.
  bool has_large_log = false;         ///< As the log of the program last said.
  std::set<wire::SessionId> known;    ///< Workers of which the file has no end yet.
  bool is_rest_wanted = false;        ///< Nothing more is expected.
  std::optional<TimePoint> rest_at;   ///< When to fold the log in, once nothing waits.
  bool is_log_kept = false;           ///< A reader keeps the log from that, as was last said.
};

/// When the file wants to be written to or brought to rest; nothing if nothing waits.
[[nodiscard]] std::optional<TimePoint> due_time(const OpenFile& file, const WriterConfig& config);

}  // namespace proofmass::coordinator::detail
