#include "coordinator/store/store_writer.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <future>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include "coordinator/store/detail/open_file.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

using detail::OpenFile;
using detail::TimePoint;

namespace {

// Entries of one transaction: enough that its cost is shared, few enough that the first of them
// does not wait long for the last.
constexpr std::size_t entries_per_commit_max = 8192;

/// Something that the caller waits for, after all that was handed over for its file.
struct Request {
  wire::CampaignId campaign;  // 0: all files.
  std::packaged_task<void()> action;
};

using Files = std::map<wire::CampaignId, OpenFile>;

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

/// What came of one attempt to write.
struct Attempted {
  CommitSummary summary;
  std::optional<std::string> failure;
  std::uint64_t log_size = 0;  // Afterwards.
};

/// Tries to write what `writing` holds, to a file that has its name before and afterwards.
Attempted try_to_write(OpenFile& file) {
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

/// Tries to fold the log in; returns why it is still needed.
std::optional<std::string> try_to_rest(Store& store) {
  try {
    return store.rest();
  } catch (const std::exception& error) {
    return error.what();
  }
}

}  // namespace

struct StoreWriter::Impl {
  Impl(std::function<void()> wake_caller, const WriterConfig& writer_config)
      : config(writer_config), wake(std::move(wake_caller)), thread([this] { run(); }) {}

  // Called by the service.
  OpenFile& file(wire::CampaignId campaign);
  [[nodiscard]] bool add(OpenFile& open_file, Entry entry);
  void wait_for(wire::CampaignId campaign, std::function<void()> action);

  // The thread.
  using Lock = std::unique_lock<std::mutex>;
  void run();
  void serve_request(Lock& lock);
  void write_due(Lock& lock);
  void look_at_all(Lock& lock);
  void write_all(wire::CampaignId campaign, Lock& lock);
  void fold(wire::CampaignId campaign, Lock& lock);
  bool write_some(wire::CampaignId campaign, std::size_t num_max, Lock& lock);
  void finish_write(wire::CampaignId campaign, OpenFile& file, Attempted attempted);
  void watch_log(wire::CampaignId campaign, OpenFile& file, std::uint64_t log_size);
  [[nodiscard]] std::optional<TimePoint> next_due_time() const;
  [[nodiscard]] std::vector<wire::CampaignId> ids() const;

  const WriterConfig config;
  const std::function<void()> wake;

  std::mutex mutex;  // Guards all that follows; see OpenFile for what it does not.
  std::condition_variable changed;
  Files files;
  std::deque<Request> requests;
  std::vector<Completion> completions;
  bool is_ending = false;
  TimePoint look_at =
      std::chrono::steady_clock::now() +
      config.look_after;  // When to look at files of which nothing is to be written.

  std::thread thread;  // Begins when all else is there.
};

OpenFile& StoreWriter::Impl::file(wire::CampaignId campaign) {
  const auto found = files.find(campaign);
  PROOFMASS_EXPECT(found != files.end());
  return found->second;
}

/// True if the file is to be written to sooner than before. @pre The lock is held.
bool StoreWriter::Impl::add(OpenFile& open_file, Entry entry) {
  const TimePoint now = std::chrono::steady_clock::now();
  const std::optional<TimePoint> due_before = due_time(open_file, config);
  note_worker(open_file, entry);
  if (detail::is_result(entry)) open_file.is_rest_wanted = false;
  open_file.waiting.add(std::move(entry), now);
  open_file.rest_at = open_file.is_rest_wanted ? std::optional(now) : std::nullopt;
  return due_time(open_file, config) != due_before;
}

void StoreWriter::Impl::wait_for(wire::CampaignId campaign, std::function<void()> action) {
  Request request{.campaign = campaign, .action = std::packaged_task<void()>(std::move(action))};
  std::future<void> done = request.action.get_future();
  {
    const std::lock_guard lock(mutex);
    requests.push_back(std::move(request));
  }
  changed.notify_one();
  done.get();
}

void StoreWriter::Impl::run() {
  Lock lock(mutex);
  while (!is_ending || !requests.empty()) {
    if (!requests.empty()) {
      serve_request(lock);
      continue;
    }
    const std::optional<TimePoint> due = next_due_time();
    if (due && *due <= std::chrono::steady_clock::now()) {
      write_due(lock);
      look_at_all(lock);
    } else if (due) {
      changed.wait_until(lock, *due);
    } else {
      changed.wait(lock);
    }
  }
  for (const wire::CampaignId campaign : ids()) write_all(campaign, lock);
}

void StoreWriter::Impl::serve_request(Lock& lock) {
  Request request = std::move(requests.front());
  requests.pop_front();
  const bool is_for_all = request.campaign == wire::CampaignId{};
  for (const wire::CampaignId campaign : is_for_all ? ids() : std::vector{request.campaign}) {
    write_all(campaign, lock);
  }
  lock.unlock();
  request.action();  // What it throws is thrown to the caller.
  lock.lock();
}

void StoreWriter::Impl::write_due(Lock& lock) {
  const TimePoint now = std::chrono::steady_clock::now();
  for (const wire::CampaignId campaign : ids()) {
    const std::optional<TimePoint> due = due_time(file(campaign), config);
    if (!due || *due > now) continue;
    if (!file(campaign).retry_at && is_written_out(file(campaign))) {
      fold(campaign, lock);
    } else {
      write_some(campaign, entries_per_commit_max, lock);
    }
  }
}

/// Finds files that lost their name while nothing was to be written.
void StoreWriter::Impl::look_at_all(Lock& lock) {
  if (std::chrono::steady_clock::now() < look_at) return;
  for (const wire::CampaignId campaign : ids()) {
    if (!file(campaign).retry_at) write_some(campaign, 0, lock);
  }
  look_at = std::chrono::steady_clock::now() + config.look_after;
}

/// Writes all that waits now, until something fails; not what is added meanwhile.
void StoreWriter::Impl::write_all(wire::CampaignId campaign, Lock& lock) {
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
void StoreWriter::Impl::fold(wire::CampaignId campaign, Lock& lock) {
  if (!write_some(campaign, 0, lock)) return;
  OpenFile& open_file = file(campaign);
  open_file.rest_at.reset();  // What is added meanwhile sets it again.
  lock.unlock();
  const std::optional<std::string> reason = try_to_rest(open_file.store);
  lock.lock();
  if (reason && open_file.is_rest_wanted) {
    open_file.rest_at = std::chrono::steady_clock::now() + config.retry_after;
  }
  if (reason.has_value() == open_file.is_log_kept) return;
  open_file.is_log_kept = reason.has_value();
  completions.emplace_back(
      FileEvent{.campaign = campaign,
                .event = reason ? wire::Event{.severity = wire::Severity::warning,
                                              .kind = "write_ahead_log_kept",
                                              .fields = {wire::Field::reason(*reason)}}
                                : wire::Event{.kind = "write_ahead_log_folded"}});
  lock.unlock();
  wake();
  lock.lock();
}

/// Tries to write what failed before or, if nothing did, up to `num_max` more entries. The file
/// stays: only the thread itself removes one.
bool StoreWriter::Impl::write_some(wire::CampaignId campaign, std::size_t num_max, Lock& lock) {
  OpenFile& open_file = file(campaign);
  if (open_file.writing.empty() && num_max > 0) {
    open_file.waiting.take(num_max, open_file.writing, std::chrono::steady_clock::now());
  }
  lock.unlock();
  Attempted attempted = try_to_write(open_file);
  const bool is_written = !attempted.failure;
  lock.lock();
  const std::size_t num_before = completions.size();
  watch_log(campaign, open_file, attempted.log_size);
  finish_write(campaign, open_file, std::move(attempted));
  const bool has_news = completions.size() > num_before;
  lock.unlock();
  if (has_news) wake();
  lock.lock();
  return is_written;
}

void StoreWriter::Impl::finish_write(wire::CampaignId campaign, OpenFile& open_file,
                                     Attempted attempted) {
  const bool has_failed_before = open_file.retry_at.has_value();
  if (attempted.failure) {
    open_file.retry_at = std::chrono::steady_clock::now() + config.retry_after;
    if (std::exchange(open_file.failure, *attempted.failure) == *attempted.failure) return;
    completions.emplace_back(StoreFailed{.campaign = campaign,
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
    completions.emplace_back(Committed{.campaign = campaign, .runs = std::move(runs)});
  }
  for (const Comparison& comparison : attempted.summary.comparisons) {
    completions.emplace_back(Compared{.campaign = campaign, .comparison = comparison});
  }
  if (has_failed_before) completions.emplace_back(StoreRecovered{.campaign = campaign});
}

void StoreWriter::Impl::watch_log(wire::CampaignId campaign, OpenFile& open_file,
                                  std::uint64_t log_size) {
  const bool is_large = log_size > config.log_size_max;
  if (is_large == open_file.has_large_log) return;
  open_file.has_large_log = is_large;
  wire::Event event{.kind = "write_ahead_log_shrunk"};
  if (is_large) {
    event = {.severity = wire::Severity::warning,
             .kind = "write_ahead_log_grown",
             .fields = {{"size_bytes", log_size},
                        wire::Field::remark("(somebody reads an old state of the file)")}};
  }
  completions.emplace_back(FileEvent{.campaign = campaign, .event = std::move(event)});
}

std::optional<TimePoint> StoreWriter::Impl::next_due_time() const {
  std::optional<TimePoint> next;
  if (!files.empty()) next = look_at;
  for (const auto& [campaign, file] : files) {
    const std::optional<TimePoint> due = due_time(file, config);
    if (due && (!next || *due < *next)) next = due;
  }
  return next;
}

std::vector<wire::CampaignId> StoreWriter::Impl::ids() const {
  std::vector<wire::CampaignId> ids;
  for (const auto& [campaign, file] : files) ids.push_back(campaign);
  return ids;
}

StoreWriter::StoreWriter(std::function<void()> wake, const WriterConfig& config)
    : impl_(std::make_unique<Impl>(std::move(wake), config)) {}

StoreWriter::~StoreWriter() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->is_ending = true;
  }
  impl_->changed.notify_one();
  impl_->thread.join();
}

void StoreWriter::open(wire::CampaignId campaign, Store store) {
  const std::vector<wire::SessionId> attached = store.attached_sessions();
  {
    const std::lock_guard lock(impl_->mutex);
    OpenFile file{.store = std::move(store),
                  .waiting = detail::WaitingEntries(impl_->config.num_records_max),
                  .writing = {},
                  .retry_at = {},
                  .failure = {},
                  .known = {},
                  .rest_at = {}};
    for (const wire::SessionId session : attached) file.known.insert(session);
    const bool is_new = impl_->files.emplace(campaign, std::move(file)).second;
    PROOFMASS_EXPECT(is_new);
  }
  impl_->changed.notify_one();
}

Store StoreWriter::close(wire::CampaignId campaign) {
  std::optional<Store> store;
  impl_->wait_for(campaign, [&] {
    const std::lock_guard lock(impl_->mutex);
    store = std::move(impl_->file(campaign).store);
    impl_->files.erase(campaign);
  });
  return std::move(*store);
}

void StoreWriter::access(wire::CampaignId campaign, const std::function<void(Store&)>& action) {
  impl_->wait_for(campaign, [&] {
    std::unique_lock lock(impl_->mutex);
    Store& store = impl_->file(campaign).store;
    lock.unlock();
    action(store);
  });
}

void StoreWriter::write(wire::CampaignId campaign, Entry entry) {
  bool is_sooner = false;
  {
    const std::lock_guard lock(impl_->mutex);
    if (campaign != wire::CampaignId{}) {
      is_sooner = impl_->add(impl_->file(campaign), std::move(entry));
    } else {
      for (auto& [id, open_file] : impl_->files) {
        if (concerns(entry, open_file)) is_sooner = impl_->add(open_file, entry) || is_sooner;
      }
    }
  }
  if (is_sooner) impl_->changed.notify_one();  // Otherwise the thread would wake for every result.
}

void StoreWriter::rest(wire::CampaignId campaign) {
  {
    const std::lock_guard lock(impl_->mutex);
    OpenFile& open_file = impl_->file(campaign);
    open_file.is_rest_wanted = true;
    open_file.rest_at = std::chrono::steady_clock::now();
  }
  impl_->changed.notify_one();
}

void StoreWriter::hurry(wire::CampaignId campaign) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->file(campaign).waiting.hurry();
  }
  impl_->changed.notify_one();
}

std::vector<Completion> StoreWriter::take_completions() {
  const std::lock_guard lock(impl_->mutex);
  return std::exchange(impl_->completions, {});
}

void StoreWriter::flush() {
  impl_->wait_for(wire::CampaignId{}, [] {});
}

}  // namespace proofmass::coordinator
