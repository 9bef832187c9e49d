#include "coordinator/page/campaign_details.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <exception>
#include <iterator>
#include <utility>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/charts/chart.hpp"
#include "coordinator/net/server_paths.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/independence.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::seconds reading_interval_min(2);
constexpr int reading_share = 75;
constexpr int reading_niceness = 10;
constexpr std::chrono::seconds pause_without_memory(2);

/// Goes on after the last event that is kept, or begins anew if that is not in the file.
void append_events(const Store& history, std::deque<StoredEvent>& events) {
  std::vector<StoredEvent> found;
  if (!events.empty()) {
    found = history.events_after(events.back().id - 1, page_events_max);
    if (found.empty() || found.front() != events.back()) {
      events.clear();
    } else {
      events.pop_back();
    }
  }
  if (events.empty()) found = history.events_after(0, page_events_max);
  events.insert(events.end(), std::move_iterator(found.begin()), std::move_iterator(found.end()));
  while (events.size() > page_events_max) events.pop_front();
}

/// A range of runs that has to be looked up costs as much as so many results of one range.
constexpr std::uint64_t results_a_range = 32;

/// The runs from `first` on, below `end`, that are not in the set.
std::vector<RunRange> missing_from(const RunSet& runs, std::uint64_t first, std::uint64_t end) {
  RunSet missing;
  if (first < end) missing.add(RunRange{{first}, end - first});
  missing.remove(runs);
  return missing.ranges();
}

/// Whether the file has what was read before. To count its runs takes long, and is done only if the
/// coordinator knows of fewer than were read.
bool goes_on(const ResultsReading* reading, const Store& store, const CampaignRecord& campaign) {
  if (reading == nullptr || !reading->is_of(store)) return false;
  return reading->num_read() <= campaign.status.num_done() ||
         reading->num_read() <= num_runs_in(store.finished_runs());
}

/// Some results more, if the coordinator knows of others than those that were read.
void read_further(const Store& store, const CampaignRecord& campaign, CampaignDetails& now) {
  const bool is_further = goes_on(now.reading.get(), store, campaign);
  if (is_further && now.num_runs == campaign.status.num_done()) return;
  ResultsReading reading = is_further ? *now.reading : ResultsReading(store);
  reading.read_further(store, page_results_a_reading);
  now.html = reading.html();
  now.num_runs = reading.num_read();
  now.reading = std::make_shared<const ResultsReading>(std::move(reading));
}

void become_unimportant() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, nullptr);
  // Of this thread alone, as Linux has it.
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), reading_niceness);
}

/// Of this thread. On a busy machine a reading may take much longer than that.
Duration cpu_time_of_thread() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

TimePoint steady_now() { return std::chrono::steady_clock::now(); }

bool is_wanted(TimePoint asked_at, TimePoint now) {
  return now - asked_at < DetailReader::wanted_for;
}

bool is_same(const CampaignRecord& a, const CampaignRecord& b) {
  return a.id == b.id && a.file == b.file;
}

std::shared_ptr<const CampaignDetails> without_room() {
  CampaignDetails details;
  details.failure =
      fmt::format("campaigns that are looked at = {} (must be fewer; try again in {} s)",
                  DetailReader::num_campaigns_max, DetailReader::wanted_for.count());
  return std::make_shared<const CampaignDetails>(std::move(details));
}

}  // namespace

ResultsReading::ResultsReading(const Store& store)
    : ResultsReading(store, *stored_campaign(store)) {}

ResultsReading::ResultsReading(const Store& store, const Campaign& campaign)
    : campaign_(store.id()),
      review_{.schema = store.schema(),
              .objectives = campaign.objectives(),
              .why_not_independent = why_not_independent(campaign)},
      statistics_(review_.objectives),
      standard_errors_(review_.schema, review_.why_not_independent.empty()),
      figures_(review_.objectives.size(), 0) {}

bool ResultsReading::is_of(const Store& store) const { return campaign_ == store.id(); }

void ResultsReading::read_further(const Store& store, std::uint64_t num_results_max) {
  std::uint64_t num_left = num_results_max;
  for (const RunRange& range : missing_from(read_, next_run_, store.num_runs())) {
    ResultReader reader = store.results(range);
    while (const std::optional<RunResult> result = reader.next()) {
      require_in_range(*result, store.schema());
      statistics_.add(*result);
      standard_errors_.add(*result);
      figures_.add(*result);
      read_.add(RunRange{result->run, 1});
      next_run_ = result->run.value + 1;
      if (--num_left == 0) return;
    }
    next_run_ = range.end();
    num_left -= std::min(num_left, results_a_range);
    if (num_left == 0) return;
  }
  next_run_ = 0;
}

CampaignStatistics ResultsReading::statistics() const {
  CampaignStatistics statistics = statistics_.statistics();
  if (!review_.why_not_independent.empty()) leave_out_intervals(statistics);
  return statistics;
}

std::string ResultsReading::html() const {
  Review review = review_;
  review.results.statistics = statistics();
  review.figures = ErrorFigures(figures_).figures();
  std::string html = "<h3>Accuracy</h3>\n" + html_table(accuracy_table(review));
  for (const Table& table : standard_error_tables(review.schema, standard_errors_.statistics())) {
    html += table_or_nothing(table);
  }
  return html + "<h3>Errors</h3>\n<figure>\n" +
         svg_of(magnitude_overview(review), SvgUse::embedded) + "</figure>\n";
}

CampaignDetails read_details(const CampaignRecord& campaign, const CampaignDetails* before) {
  CampaignDetails now = before == nullptr ? CampaignDetails() : *before;
  now.failure.clear();
  try {
    const Store store = Store::open_read_only(campaign.file);
    append_events(store, now.events);
    now.losses = store.losses();
    now.ends = store.ends_without_estimate();
    now.given_up = store.given_up_records(page_given_up_max);
    now.attempts = store.recent_attempts(page_attempts_max, page_losses_max);
    read_further(store, campaign, now);
  } catch (const std::exception& error) {
    now.failure = ServerPaths(campaign.file.parent_path()).hidden_in(error.what());
  }
  return now;
}

TimePoint end_of_rest(TimePoint ended_at, Duration cpu_time) {
  return ended_at + reading_share * cpu_time;
}

DetailReader::DetailReader(ReadDetails read)
    : read_(std::move(read)), thread_([this] { work(); }) {}

DetailReader::~DetailReader() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::shared_ptr<const CampaignDetails> DetailReader::details(const CampaignRecord& campaign,
                                                             TimePoint now) {
  const std::string& name = campaign.status.name();
  const std::lock_guard lock(mutex_);
  if (!watched_.contains(name) && !make_room(now)) return without_room();
  Watched& watched = watched_[name];
  if (!is_same(watched.campaign, campaign)) watched = {};  // Another one of that name.
  watched.campaign = campaign;
  watched.asked_at = now;
  changed_.notify_all();
  return watched.details;
}

bool DetailReader::make_room(TimePoint now) {
  if (watched_.size() < num_campaigns_max) return true;
  const auto oldest =
      std::ranges::min_element(watched_, {}, [](const auto& item) { return item.second.asked_at; });
  if (is_wanted(oldest->second.asked_at, now)) return false;
  watched_.erase(oldest);
  return true;
}

std::optional<std::string> DetailReader::choose(TimePoint now, TimePoint& look_again) const {
  const decltype(watched_)::value_type* first = nullptr;
  for (const auto& item : watched_) {
    if (!is_wanted(item.second.asked_at, now)) continue;
    if (first == nullptr || item.second.due < first->second.due) first = &item;
  }
  look_again = std::max(first == nullptr ? now + wanted_for : first->second.due, rests_until_);
  return look_again <= now ? std::optional(first->first) : std::nullopt;
}

void DetailReader::read(const std::string& name, std::unique_lock<std::mutex>& lock) {
  const CampaignRecord campaign = watched_.at(name).campaign;
  const std::shared_ptr<const CampaignDetails> before = watched_.at(name).details;
  lock.unlock();
  const TimePoint began_at = steady_now();
  const Duration cpu_before = cpu_time_of_thread();
  auto details = std::make_shared<CampaignDetails>(read_(campaign, before.get()));
  // What a reading that failed has is as old as before.
  if (before == nullptr || details->failure.empty()) details->read_at = began_at;
  const TimePoint ended_at = steady_now();
  lock.lock();
  rests_until_ = end_of_rest(ended_at, cpu_time_of_thread() - cpu_before);
  const auto found = watched_.find(name);
  if (found == watched_.end() || !is_same(found->second.campaign, campaign)) return;
  found->second.due = ended_at + reading_interval_min;
  found->second.details = std::move(details);
}

void DetailReader::work() {
  become_unimportant();
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    try {
      TimePoint look_again{};
      if (const std::optional<std::string> name = choose(steady_now(), look_again)) {
        read(*name, lock);
      } else {
        changed_.wait_until(lock, look_again);
      }
    } catch (const std::exception&) {
      // Memory is short: the page shows what it has.
      if (!lock.owns_lock()) lock.lock();
      rests_until_ = steady_now() + pause_without_memory;
    }
  }
}

}  // namespace proofmass::coordinator
