#include "coordinator/store/detail/open_file.hpp"

#include <algorithm>
#include <exception>
#include <utility>
#include <variant>

namespace proofmass::coordinator::detail {

std::optional<TimePoint> due_time(const OpenFile& file, const CommitTimes& times) {
  if (file.retry_at) return file.retry_at;
  const std::optional<TimePoint> since = file.waiting.waiting_since();
  if (!since) return file.rest_at;
  const TimePoint due = *since + times.record_after;
  const std::optional<TimePoint> urgent_since = file.waiting.urgent_since();
  if (!urgent_since) return due;
  if (file.waiting.num_results() >= times.commit_runs_max) return urgent_since;
  return std::min(due, *urgent_since + times.commit_after);
}

// What is committed while the file loses its name is in the open file, and so in the copy that gets
// the name: it is durable once the file has its name, and must not be written twice.
Attempted try_to_write(OpenFile& file) {
  Attempted attempted;
  try {
    attempted.file_return = file.store.return_to_place();
    if (!file.unconfirmed && !file.writing.empty()) {
      file.unconfirmed = file.store.write(file.writing);
    }
    if (const auto file_return = file.store.return_to_place()) attempted.file_return = file_return;
    attempted.summary = std::exchange(file.unconfirmed, std::nullopt).value_or(CommitSummary{});
  } catch (const std::exception& error) {
    attempted.failure = error.what();
  }
  attempted.log_size = file.store.log_size();
  return attempted;
}

std::optional<std::string> try_to_rest(Store& store) {
  try {
    return store.rest();
  } catch (const std::exception& error) {
    return error.what();
  }
}

std::vector<RunIndex> delivered_runs(const std::vector<Entry>& entries) {
  std::vector<RunIndex> runs;
  for (const Entry& entry : entries) {
    if (const auto* delivery = std::get_if<Delivery>(&entry)) runs.push_back(delivery->result.run);
  }
  return runs;
}

}  // namespace proofmass::coordinator::detail
