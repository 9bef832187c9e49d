#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

using TimePoint = std::chrono::steady_clock::time_point;

/// Whether a worker waits for its acknowledgement.
[[nodiscard]] bool is_result(const Entry& entry);

/// What waits to be written to one campaign file, in the order in which it was handed over.
class WaitingEntries {
 public:
  /// @param num_records_max  Losses and events beyond this many are counted and dropped.
  explicit WaitingEntries(std::size_t num_records_max) : num_records_max_(num_records_max) {}

  void add(Entry entry, TimePoint now);

  /// Moves up to `num_max` entries to the end of `entries`, and what was dropped as an event.
  void take(std::size_t num_max, std::vector<Entry>& entries, TimePoint now);

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] std::size_t num_results() const { return num_results_; }
  /// Since when the oldest one waits, roughly; nothing if none does.
  [[nodiscard]] std::optional<TimePoint> waiting_since() const { return waiting_since_; }
  /// The same of those that are urgent: results, and how the campaign is to be served.
  [[nodiscard]] std::optional<TimePoint> urgent_since() const { return urgent_since_; }

 private:
  std::size_t num_records_max_;
  std::deque<Entry> entries_;
  std::size_t num_results_ = 0;  ///< Of the entries, those that a worker waits for.
  std::size_t num_urgent_ = 0;   ///< Those, and how the campaign is to be served.
  std::size_t num_records_ = 0;  ///< Losses and events among them.
  std::uint64_t num_dropped_ = 0;
  std::optional<TimePoint> waiting_since_;
  std::optional<TimePoint> urgent_since_;
};

}  // namespace proofmass::coordinator::detail
