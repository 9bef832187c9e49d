#include "coordinator/store/detail/open_file.hpp"

#include <algorithm>
#include <iterator>
#include <utility>
#include <variant>

namespace proofmass::coordinator::detail {
namespace {

// What somebody waits for. The rest is history, which shares the next commit.
bool is_urgent(const Entry& entry) {
  return is_result(entry) || std::holds_alternative<CampaignControl>(entry);
}

// What the history of a campaign can do without.
bool is_record(const Entry& entry) {
  return std::holds_alternative<ReturnedRuns>(entry) || std::holds_alternative<EventEntry>(entry);
}

}  // namespace

bool is_result(const Entry& entry) {
  return std::holds_alternative<Delivery>(entry) || std::holds_alternative<SecondDelivery>(entry);
}

void WaitingEntries::add(Entry entry, TimePoint now) {
  if (is_record(entry) && num_records_ >= num_records_max_) {
    ++num_dropped_;
    return;
  }
  if (is_result(entry)) ++num_results_;
  if (is_record(entry)) ++num_records_;
  if (is_urgent(entry) && num_urgent_++ == 0) urgent_since_ = now;
  if (entries_.empty()) waiting_since_ = now;
  entries_.push_back(std::move(entry));
}

void WaitingEntries::take(std::size_t num_max, std::vector<Entry>& entries, TimePoint now) {
  const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(std::min(num_max, size()));
  num_results_ -= static_cast<std::size_t>(std::count_if(entries_.begin(), end, is_result));
  num_urgent_ -= static_cast<std::size_t>(std::count_if(entries_.begin(), end, is_urgent));
  num_records_ -= static_cast<std::size_t>(std::count_if(entries_.begin(), end, is_record));
  std::move(entries_.begin(), end, std::back_inserter(entries));
  entries_.erase(entries_.begin(), end);
  if (num_results_ == 0) is_hurried_ = false;
  waiting_since_ = entries_.empty() ? std::nullopt : std::optional(now);
  urgent_since_ = num_urgent_ == 0 ? std::nullopt : std::optional(now);
  if (num_dropped_ == 0) return;
  entries.push_back(
      entry_of({.kind = "records_dropped",
                .fields = {{"losses_and_events", std::exchange(num_dropped_, 0)},
                           wire::Field::remark("(the disk did not take them for too long)")}}));
}

std::optional<TimePoint> due_time(const OpenFile& file, const WriterConfig& config) {
  if (file.retry_at) return file.retry_at;
  const std::optional<TimePoint> since = file.waiting.waiting_since();
  if (!since) return file.rest_at;
  const TimePoint due = *since + config.record_after;
  const std::optional<TimePoint> urgent_since = file.waiting.urgent_since();
  if (!urgent_since) return due;
  const bool is_complete = file.waiting.num_results() >= config.commit_runs_max;
  if (is_complete || file.waiting.is_hurried()) return urgent_since;
  return std::min(due, *urgent_since + config.commit_after);
}

}  // namespace proofmass::coordinator::detail
