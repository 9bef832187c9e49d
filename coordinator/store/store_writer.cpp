#include "coordinator/store/store_writer.hpp"

#include <algorithm>
#include <exception>
#include <future>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>
#include <variant>

#include "core/error.hpp"

namespace proofmass::coordinator {

namespace {

// Entries of one transaction: enough that its cost is shared, few enough that the first of them
// does not wait long for the last.
constexpr std::size_t entries_per_commit_max = 8192;

template <typename... Kinds>
bool is_one_of(const Entry& entry) {
  return (std::holds_alternative<Kinds>(entry) || ...);
}

// A worker waits for its acknowledgement.
bool is_result(const Entry& entry) { return is_one_of<Delivery, SecondDelivery>(entry); }

// What the history of a campaign can do without.
bool is_record(const Entry& entry) { return is_one_of<ReturnedRuns, EventEntry>(entry); }

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
      attempted.comparisons = file.store.write(file.writing);
    }
  } catch (const std::exception& error) {
    attempted.failure = error.what();
  }
  attempted.log_size = file.store.log_size();
  return attempted;
}

StoreWriter::OpenFile& StoreWriter::file(wire::CampaignId campaign) {
  const auto found = files_.find(campaign);
  PROOFMASS_EXPECT(found != files_.end());
  return found->second;
}

/// True if the file is to be written to sooner than before. What somebody waits for is written
/// soon; the rest is history, which shares the next commit. @pre The lock is held.
bool StoreWriter::add(OpenFile& file, Entry entry) {
  const std::optional<TimePoint> due_before = file.due;
  if (const auto* joined = std::get_if<WorkerJoined>(&entry)) file.known.insert(joined->session);
  if (const auto* ended = std::get_if<WorkerEnded>(&entry)) file.known.erase(ended->session);
  if (is_result(entry)) file.is_rest_wanted = false;
  file.is_fold_due = file.is_rest_wanted;
  if (is_record(entry) && file.num_records >= config_.num_records_max) {
    ++file.num_dropped;
    return false;
  }
  if (is_result(entry)) ++file.num_results;
  if (is_record(entry)) ++file.num_records;
  const bool is_urgent = is_one_of<Delivery, SecondDelivery, CampaignControl>(entry);
  file.waiting.push_back(std::move(entry));
  if (file.has_failed) return false;
  const TimePoint now = std::chrono::steady_clock::now();
  const bool is_complete = file.num_results >= config_.commit_runs_max;
  file.be_due(is_complete ? now : now + (is_urgent ? config_.commit_after : config_.record_after));
  return file.due != due_before;
}

void StoreWriter::change(const std::function<void()>& action) {
  {
    const std::lock_guard lock(mutex_);
    action();
  }
  changed_.notify_one();
}

void StoreWriter::wait_for(wire::CampaignId campaign, std::function<void()> action) {
  Request request{.campaign = campaign, .action = std::move(action), .done = {}};
  std::future<void> done = request.done.get_future();
  change([&] { requests_.push_back(std::move(request)); });
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
    const OpenFile& open_file = file(campaign);
    if (!open_file.due || *open_file.due > now) continue;
    if (!open_file.has_failed && open_file.is_written_out()) {
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
    if (!file(campaign).has_failed) write_some(campaign, 0, lock);
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
  if (file(campaign).is_fold_due && file(campaign).is_written_out()) fold(campaign, lock);
}

/// Brings a file of which nothing waits to rest.
void StoreWriter::fold(wire::CampaignId campaign, Lock& lock) {
  OpenFile& open_file = file(campaign);
  if (!write_some(campaign, 0, lock) || !open_file.is_written_out()) return;
  open_file.is_fold_due = false;  // What is added meanwhile sets both again.
  open_file.due.reset();
  lock.unlock();
  const std::optional<std::string> reason = try_to_rest(open_file.store);
  lock.lock();
  if (reason && open_file.is_rest_wanted) {
    open_file.is_fold_due = true;
    open_file.be_due(std::chrono::steady_clock::now() + config_.retry_after);
  }
  // One failure is that of a short reader, such as the answer to whoever waited for the campaign.
  constexpr int num_failures_said = 2;
  const int num_before =
      std::exchange(open_file.num_folds_failed, reason ? open_file.num_folds_failed + 1 : 0);
  if (reason ? num_before + 1 != num_failures_said : num_before < num_failures_said) return;
  completions_.emplace_back(FileEvent{
      .campaign = campaign,
      .event = reason ? wire::Event::warning("write_ahead_log_kept", {wire::Field::reason(*reason)})
                      : wire::Event::info("write_ahead_log_folded")});
  lock.unlock();
  wake_();
  lock.lock();
}

/// Moves entries from those that wait to those that are written, and what was dropped as an event.
void StoreWriter::take(OpenFile& file, std::size_t num_max) {
  for (; num_max > 0 && !file.waiting.empty(); --num_max) {
    if (is_result(file.waiting.front())) --file.num_results;
    if (is_record(file.waiting.front())) --file.num_records;
    file.writing.push_back(std::move(file.waiting.front()));
    file.waiting.pop_front();
  }
  file.due.reset();
  if (!file.waiting.empty()) file.due = std::chrono::steady_clock::now();
  if (file.num_dropped == 0) return;
  file.writing.push_back(entry_of(wire::Event::info(
      "records_dropped", {{"losses_and_events", std::exchange(file.num_dropped, 0)},
                          wire::Field::remark("(the disk did not take them for too long)")})));
}

/// Tries to write what failed before or, if nothing did, up to `num_max` more entries. The file
/// stays: only the thread itself removes one.
bool StoreWriter::write_some(wire::CampaignId campaign, std::size_t num_max, Lock& lock) {
  OpenFile& open_file = file(campaign);
  if (open_file.writing.empty() && num_max > 0) take(open_file, num_max);
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
  const bool has_failed_before = std::exchange(open_file.has_failed, attempted.failure.has_value());
  const TimePoint now = std::chrono::steady_clock::now();
  if (attempted.failure) {
    open_file.due = now + config_.retry_after;
    if (std::exchange(open_file.failure, *attempted.failure) == *attempted.failure) return;
    completions_.emplace_back(StoreFailed{.campaign = campaign,
                                          .text = *attempted.failure,
                                          .is_abandoned = open_file.store.is_abandoned()});
    return;
  }
  open_file.failure.clear();
  if (has_failed_before) open_file.due.reset();
  const bool is_more_due = open_file.waiting.empty() ? open_file.is_fold_due : has_failed_before;
  if (is_more_due && (has_failed_before || !open_file.writing.empty())) open_file.be_due(now);
  std::vector<RunIndex> runs;
  for (const Entry& entry : open_file.writing) {
    if (const auto* delivery = std::get_if<Delivery>(&entry)) runs.push_back(delivery->result.run);
  }
  open_file.writing.clear();
  if (!runs.empty()) {
    completions_.emplace_back(Committed{.campaign = campaign, .runs = std::move(runs)});
  }
  for (const Comparison& comparison : attempted.comparisons) {
    completions_.emplace_back(Compared{.campaign = campaign, .comparison = comparison});
  }
  if (has_failed_before) completions_.emplace_back(StoreRecovered{.campaign = campaign});
}

void StoreWriter::watch_log(wire::CampaignId campaign, OpenFile& open_file,
                            std::uint64_t log_size) {
  const bool is_large = log_size > config_.log_size_max;
  if (is_large == open_file.has_large_log) return;
  open_file.has_large_log = is_large;
  wire::Event event = wire::Event::info("write_ahead_log_shrunk");
  if (is_large) {
    event =
        wire::Event::warning("write_ahead_log_grown",
                             {{"size_bytes", log_size},
                              wire::Field::remark("(somebody reads an old state of the file)")});
  }
  completions_.emplace_back(FileEvent{.campaign = campaign, .event = std::move(event)});
}

std::optional<StoreWriter::TimePoint> StoreWriter::next_due_time() const {
  std::optional<TimePoint> next;
  if (!files_.empty()) next = look_at_;
  for (const auto& [campaign, file] : files_) {
    if (file.due && (!next || *file.due < *next)) next = file.due;
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
  change([this] { is_ending_ = true; });
  thread_.join();
}

void StoreWriter::open(wire::CampaignId campaign, Store store) {
  const std::vector<wire::SessionId> attached = store.attached_sessions();
  change([&] {
    OpenFile file{.store = std::move(store), .known = {attached.begin(), attached.end()}};
    const bool is_new = files_.emplace(campaign, std::move(file)).second;
    PROOFMASS_EXPECT(is_new);
  });
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
      const auto* const ended = std::get_if<WorkerEnded>(&entry);
      for (auto& [id, open_file] : files_) {
        const bool is_concerned =
            ended != nullptr ? open_file.known.contains(ended->session) : !open_file.is_rest_wanted;
        if (is_concerned) is_sooner = add(open_file, entry) || is_sooner;
      }
    }
  }
  if (is_sooner) changed_.notify_one();  // Otherwise the thread would wake for every result.
}

void StoreWriter::rest(wire::CampaignId campaign) {
  change([&] {
    OpenFile& open_file = file(campaign);
    open_file.is_rest_wanted = open_file.is_fold_due = true;
    if (!open_file.waiting.empty() || open_file.has_failed) return;
    open_file.be_due(std::chrono::steady_clock::now());
  });
}

void StoreWriter::hurry(wire::CampaignId campaign) {
  change([&] {
    OpenFile& open_file = file(campaign);
    if (open_file.num_results == 0 || open_file.has_failed) return;
    open_file.be_due(std::chrono::steady_clock::now());
  });
}

std::vector<Completion> StoreWriter::take_completions() {
  const std::lock_guard lock(mutex_);
  return std::exchange(completions_, {});
}

void StoreWriter::flush() {
  wait_for(wire::CampaignId{}, [] {});
}

}  // namespace proofmass::coordinator
