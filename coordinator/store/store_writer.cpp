#include "coordinator/store/store_writer.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <future>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include "core/error.hpp"

namespace proofmass::coordinator {

namespace detail {
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

}  // namespace detail

using detail::OpenFile;
using detail::TimePoint;

namespace {

// Entries of one transaction: enough that its cost is shared, few enough that the first of them
// does not wait long for the last.
constexpr std::size_t entries_per_commit_max = 8192;

bool is_written_out(const OpenFile& file) {
  return file.writing.empty() && file.waiting.size() == 0;
}

/// Whether an entry that is for no single campaign is for this file.
bool concerns(const Entry& entry, const OpenFile& file) {
  const auto* const ended = std::get_if<WorkerEnded>(&entry);
  return ended != nullptr ? file.known.contains(ended->session) : !file.is_rest_wanted;
}

/// Keeps in mind which workers the file has without an end.
void note_worker(OpenFile& file, const Entry& entry) {
  if (const auto* joined = std::get_if<WorkerJoined>(&entry)) file.known.insert(joined->session);
  if (const auto* ended = std::get_if<WorkerEnded>(&entry)) file.known.erase(ended->session);
}

/// Tries to fold the log in; returns why it is still needed.
std::optional<std::string> try_to_rest(Store& store) {
  try {
    return store.rest();
  } catch (const std::exception& error) {
    return error.what();
  }
}

}  // namespace

/// Tries to write what `writing` holds, to a file that has its name before and afterwards.
StoreWriter::Attempted StoreWriter::try_to_write(OpenFile& file) {
  Attempted attempted;
  try {
    if (file.writing.empty()) {
      file.store.check_place();
    } else {
      attempted.summary = file.store.write(file.writing);
    }
  } catch (const std::exception& error) {
    attempted.failure = error.what();
  }
  attempted.log_size = file.store.log_size();
  return attempted;
}

OpenFile& StoreWriter::file(wire::CampaignId campaign) {
  const auto found = files_.find(campaign);
  PROOFMASS_EXPECT(found != files_.end());
  return found->second;
}

/// True if the file is to be written to sooner than before. @pre The lock is held.
bool StoreWriter::add(OpenFile& open_file, Entry entry) {
  const TimePoint now = std::chrono::steady_clock::now();
  const std::optional<TimePoint> due_before = due_time(open_file, config_);
  note_worker(open_file, entry);
  if (detail::is_result(entry)) open_file.is_rest_wanted = false;
  open_file.waiting.add(std::move(entry), now);
  open_file.rest_at = open_file.is_rest_wanted ? std::optional(now) : std::nullopt;
  return due_time(open_file, config_) != due_before;
}

void StoreWriter::wait_for(wire::CampaignId campaign, std::function<void()> action) {
  Request request{.campaign = campaign, .action = std::move(action), .done = {}};
  std::future<void> done = request.done.get_future();
  {
    const std::lock_guard lock(mutex_);
    requests_.push_back(std::move(request));
  }
  changed_.notify_one();
  done.get();
}

void StoreWriter::run() {
  Lock lock(mutex_);
  while (!is_ending_ || !requests_.empty()) {
    if (!requests_.empty()) {
      serve_request(lock);
      continue;
    }
    const std::optional<TimePoint> due = next_due_time();
    if (due && *due <= std::chrono::steady_clock::now()) {
      write_due(lock);
      look_at_all(lock);
    } else if (due) {
      changed_.wait_until(lock, *due);
    } else {
      changed_.wait(lock);
    }
  }
  for (const wire::CampaignId campaign : ids()) write_all(campaign, lock);
}

void StoreWriter::serve_request(Lock& lock) {
  Request request = std::move(requests_.front());
  requests_.pop_front();
  const bool is_for_all = request.campaign == wire::CampaignId{};
  for (const wire::CampaignId campaign : is_for_all ? ids() : std::vector{request.campaign}) {
    write_all(campaign, lock);
  }
  lock.unlock();
  try {
    request.action();
    request.done.set_value();
  } catch (...) {
    request.done.set_exception(std::current_exception());
  }
  lock.lock();
}

void StoreWriter::write_due(Lock& lock) {
  const TimePoint now = std::chrono::steady_clock::now();
  for (const wire::CampaignId campaign : ids()) {
    const std::optional<TimePoint> due = due_time(file(campaign), config_);
    if (!due || *due > now) continue;
    if (!file(campaign).retry_at && is_written_out(file(campaign))) {
      fold(campaign, lock);
    } else {
      write_some(campaign, entries_per_commit_max, lock);
    }
  }
}

/// Finds files that lost their name while nothing was to be written.
void StoreWriter::look_at_all(Lock& lock) {
  if (std::chrono::steady_clock::now() < look_at_) return;
  for (const wire::CampaignId campaign : ids()) {
    if (!file(campaign).retry_at) write_some(campaign, 0, lock);
  }
  look_at_ = std::chrono::steady_clock::now() + config_.look_after;
}

/// Writes all that waits now, until something fails; not what is added meanwhile.
void StoreWriter::write_all(wire::CampaignId campaign, Lock& lock) {
  std::size_t num_left = file(campaign).waiting.size();
  bool is_written = write_some(campaign, 0, lock);
  while (is_written && num_left > 0) {
    const std::size_t num_entries = std::min(num_left, entries_per_commit_max);
    is_written = write_some(campaign, num_entries, lock);
    num_left -= num_entries;
  }
  if (file(campaign).rest_at && is_written_out(file(campaign))) fold(campaign, lock);
}

/// Brings a file of which nothing waits to rest.
void StoreWriter::fold(wire::CampaignId campaign, Lock& lock) {
  if (!write_some(campaign, 0, lock)) return;
  OpenFile& open_file = file(campaign);
  open_file.rest_at.reset();  // What is added meanwhile sets it again.
  lock.unlock();
  const std::optional<std::string> reason = try_to_rest(open_file.store);
  lock.lock();
  if (reason && open_file.is_rest_wanted) {
    open_file.rest_at = std::chrono::steady_clock::now() + config_.retry_after;
  }
  if (reason.has_value() == open_file.is_log_kept) return;
  open_file.is_log_kept = reason.has_value();
  completions_.emplace_back(
      FileEvent{.campaign = campaign,
                .event = reason ? wire::Event{.severity = wire::Severity::warning,
                                              .kind = "write_ahead_log_kept",
                                              .fields = {wire::Field::reason(*reason)}}
                                : wire::Event{.kind = "write_ahead_log_folded"}});
  lock.unlock();
  wake_();
  lock.lock();
}

/// Tries to write what failed before or, if nothing did, up to `num_max` more entries. The file
/// stays: only the thread itself removes one.
bool StoreWriter::write_some(wire::CampaignId campaign, std::size_t num_max, Lock& lock) {
  OpenFile& open_file = file(campaign);
  if (open_file.writing.empty() && num_max > 0) {
    open_file.waiting.take(num_max, open_file.writing, std::chrono::steady_clock::now());
  }
  lock.unlock();
  Attempted attempted = try_to_write(open_file);
  const bool is_written = !attempted.failure;
  lock.lock();
  const std::size_t num_before = completions_.size();
  watch_log(campaign, open_file, attempted.log_size);
  finish_write(campaign, open_file, std::move(attempted));
  const bool has_news = completions_.size() > num_before;
  lock.unlock();
  if (has_news) wake_();
  lock.lock();
  return is_written;
}

void StoreWriter::finish_write(wire::CampaignId campaign, OpenFile& open_file,
                               Attempted attempted) {
  const bool has_failed_before = open_file.retry_at.has_value();
  if (attempted.failure) {
    open_file.retry_at = std::chrono::steady_clock::now() + config_.retry_after;
    if (std::exchange(open_file.failure, *attempted.failure) == *attempted.failure) return;
    completions_.emplace_back(StoreFailed{.campaign = campaign,
                                          .text = *attempted.failure,
                                          .is_abandoned = open_file.store.is_abandoned()});
    return;
  }
  open_file.failure.clear();
  open_file.retry_at.reset();
  std::vector<RunIndex> runs;
  for (const Entry& entry : open_file.writing) {
    if (const auto* delivery = std::get_if<Delivery>(&entry)) runs.push_back(delivery->result.run);
  }
  open_file.writing.clear();
  if (!runs.empty()) {
    completions_.emplace_back(Committed{.campaign = campaign, .runs = std::move(runs)});
  }
  for (const Comparison& comparison : attempted.summary.comparisons) {
    completions_.emplace_back(Compared{.campaign = campaign, .comparison = comparison});
  }
  if (has_failed_before) completions_.emplace_back(StoreRecovered{.campaign = campaign});
}

void StoreWriter::watch_log(wire::CampaignId campaign, OpenFile& open_file,
                            std::uint64_t log_size) {
  const bool is_large = log_size > config_.log_size_max;
  if (is_large == open_file.has_large_log) return;
  open_file.has_large_log = is_large;
  wire::Event event{.kind = "write_ahead_log_shrunk"};
  if (is_large) {
    event = {.severity = wire::Severity::warning,
             .kind = "write_ahead_log_grown",
             .fields = {{"size_bytes", log_size},
                        wire::Field::remark("(somebody reads an old state of the file)")}};
  }
  completions_.emplace_back(FileEvent{.campaign = campaign, .event = std::move(event)});
}

std::optional<TimePoint> StoreWriter::next_due_time() const {
  std::optional<TimePoint> next;
  if (!files_.empty()) next = look_at_;
  for (const auto& [campaign, file] : files_) {
    const std::optional<TimePoint> due = due_time(file, config_);
    if (due && (!next || *due < *next)) next = due;
  }
  return next;
}

std::vector<wire::CampaignId> StoreWriter::ids() const {
  std::vector<wire::CampaignId> ids;
  for (const auto& [campaign, file] : files_) ids.push_back(campaign);
  return ids;
}

StoreWriter::StoreWriter(std::function<void()> wake, const WriterConfig& config)
    : config_(config), wake_(std::move(wake)), thread_([this] { run(); }) {}

StoreWriter::~StoreWriter() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void StoreWriter::open(wire::CampaignId campaign, Store store) {
  const std::vector<wire::SessionId> attached = store.attached_sessions();
  {
    const std::lock_guard lock(mutex_);
    OpenFile file{.store = std::move(store),
                  .waiting = detail::WaitingEntries(config_.num_records_max),
                  .writing = {},
                  .retry_at = {},
                  .failure = {},
                  .known = {},
                  .rest_at = {}};
    for (const wire::SessionId session : attached) file.known.insert(session);
    const bool is_new = files_.emplace(campaign, std::move(file)).second;
    PROOFMASS_EXPECT(is_new);
  }
  changed_.notify_one();
}

Store StoreWriter::close(wire::CampaignId campaign) {
  std::optional<Store> store;
  wait_for(campaign, [&] {
    const std::lock_guard lock(mutex_);
    store = std::move(file(campaign).store);
    files_.erase(campaign);
  });
  return std::move(*store);
}

void StoreWriter::access(wire::CampaignId campaign, const std::function<void(Store&)>& action) {
  wait_for(campaign, [&] {
    std::unique_lock lock(mutex_);
    Store& store = file(campaign).store;
    lock.unlock();
    action(store);
  });
}

void StoreWriter::write(wire::CampaignId campaign, Entry entry) {
  bool is_sooner = false;
  {
    const std::lock_guard lock(mutex_);
    if (campaign != wire::CampaignId{}) {
      is_sooner = add(file(campaign), std::move(entry));
    } else {
      for (auto& [id, open_file] : files_) {
        if (concerns(entry, open_file)) is_sooner = add(open_file, entry) || is_sooner;
      }
    }
  }
  if (is_sooner) changed_.notify_one();  // Otherwise the thread would wake for every result.
}

void StoreWriter::rest(wire::CampaignId campaign) {
  {
    const std::lock_guard lock(mutex_);
    OpenFile& open_file = file(campaign);
    open_file.is_rest_wanted = true;
    open_file.rest_at = std::chrono::steady_clock::now();
  }
  changed_.notify_one();
}

void StoreWriter::hurry(wire::CampaignId campaign) {
  {
    const std::lock_guard lock(mutex_);
    file(campaign).waiting.hurry();
  }
  changed_.notify_one();
}

std::vector<Completion> StoreWriter::take_completions() {
  const std::lock_guard lock(mutex_);
  return std::exchange(completions_, {});
}

void StoreWriter::flush() {
  wait_for(wire::CampaignId{}, [] {});
}

}  // namespace proofmass::coordinator
