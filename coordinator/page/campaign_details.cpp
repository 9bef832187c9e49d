#include "coordinator/page/campaign_details.hpp"

#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <exception>
#include <utility>

#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::seconds reading_interval_min(2);
constexpr int reading_share = 150;
constexpr int reading_share_of_all = 75;
constexpr int reading_niceness = 10;

std::shared_ptr<const CampaignEvents> read_events_of(const std::filesystem::path& file,
                                                     const CampaignEvents* before) {
  auto now = std::make_shared<CampaignEvents>();
  if (before != nullptr) now->events = before->events;
  try {
    const CampaignHistory history(file);
    const std::uint64_t last = now->events.empty() ? 0 : now->events.back().id;
    for (StoredEvent& event : history.events_after(last, page_events_max)) {
      now->events.push_back(std::move(event));
    }
    while (now->events.size() > page_events_max) now->events.pop_front();
    now->losses = history.losses();
    now->ends = history.ends_without_estimate();
    now->given_up = history.given_up(page_given_up_max);
    now->attempts = history.recent_attempts(page_attempts_max, page_losses_max);
  } catch (const std::exception& error) {
    now->failure = error.what();
  }
  return now;
}

std::shared_ptr<const CampaignResults> read_results_of(const std::filesystem::path& file,
                                                       const CampaignResults* before) {
  auto now = std::make_shared<CampaignResults>();
  if (before != nullptr) now->reading = before->reading;
  try {
    const Store store = Store::open_read_only(file);
    const bool goes_on = now->reading != nullptr && now->reading->is_of(store);
    ResultsReading reading = goes_on ? *now->reading : ResultsReading(store);
    reading.read_further(store, page_results_a_reading);
    now->html = reading.results().html();
    now->json = reading.results().json();
    now->num_runs = reading.num_read();
    now->reading = std::make_shared<const ResultsReading>(std::move(reading));
  } catch (const std::exception& error) {
    now->failure = error.what();
  }
  return now;
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

}  // namespace

DetailSources database_sources() {
  return {.read_events = read_events_of, .read_results = read_results_of};
}

TimePoint next_reading(TimePoint ended_at, Duration cpu_time) {
  return ended_at + std::max<Duration>(reading_interval_min, reading_share * cpu_time);
}

TimePoint end_of_rest(TimePoint ended_at, Duration cpu_time) {
  return ended_at + reading_share_of_all * cpu_time;
}

DetailReader::DetailReader(DetailSources sources)
    : sources_(std::move(sources)), thread_([this] { work(); }) {}

DetailReader::~DetailReader() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

CampaignDetails DetailReader::details(const std::string& name, const DetailSubject& campaign,
                                      TimePoint now) {
  const std::lock_guard lock(mutex_);
  Watched& watched = watched_[name];
  if (watched.campaign.file != campaign.file) watched = {};  // Another one of that name.
  watched.campaign = campaign;
  watched.asked_at = now;
  CampaignDetails details = watched.details;
  forget_oldest();
  changed_.notify_all();
  return details;
}

void DetailReader::forget_oldest() {
  if (watched_.size() <= num_campaigns_max) return;
  watched_.erase(std::ranges::min_element(watched_, {},
                                          [](const auto& item) { return item.second.asked_at; }));
}

std::optional<DetailReader::Choice> DetailReader::choose(TimePoint now,
                                                         TimePoint& look_again) const {
  look_again = now + wanted_for;
  if (now < rests_until_) {
    look_again = rests_until_;
    return std::nullopt;
  }
  std::optional<Choice> choice;
  TimePoint due_first = now;
  const auto consider = [&](const std::string& name, Part part, TimePoint due) {
    if (due > now) {
      look_again = std::min(look_again, due);
    } else if (!choice || due < due_first) {
      choice = Choice{.name = name, .part = part};
      due_first = due;
    }
  };
  for (const auto& [name, watched] : watched_) {
    if (now - watched.asked_at >= wanted_for) continue;
    consider(name, Part::events, watched.events_due);
    const CampaignResults* const results = watched.details.results.get();
    if (results == nullptr || results->num_runs < watched.campaign.num_finished) {
      consider(name, Part::results, watched.results_due);
    }
  }
  return choice;
}

void DetailReader::read(const Choice& choice, std::unique_lock<std::mutex>& lock) {
  const DetailSubject campaign = watched_.at(choice.name).campaign;
  const CampaignDetails before = watched_.at(choice.name).details;
  lock.unlock();
  const TimePoint began_at = steady_now();
  const Duration cpu_before = cpu_time_of_thread();
  std::shared_ptr<const CampaignEvents> events;
  std::shared_ptr<const CampaignResults> results;
  if (choice.part == Part::events) {
    events = sources_.read_events(campaign.file, before.events.get());
  } else {
    results = sources_.read_results(campaign.file, before.results.get());
  }
  const TimePoint ended_at = steady_now();
  const Duration cpu_time = cpu_time_of_thread() - cpu_before;
  const TimePoint due = next_reading(ended_at, cpu_time);
  lock.lock();
  rests_until_ = end_of_rest(ended_at, cpu_time);
  const auto found = watched_.find(choice.name);
  if (found == watched_.end() || found->second.campaign.file != campaign.file) return;
  Watched& watched = found->second;
  if (events != nullptr) {
    watched.details.events = std::move(events);
    watched.details.events_at = began_at;
    watched.events_due = due;
    return;
  }
  watched.details.results = std::move(results);
  watched.details.results_at = began_at;
  watched.results_due = due;
}

void DetailReader::work() {
  become_unimportant();
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    TimePoint look_again{};
    const std::optional<Choice> choice = choose(steady_now(), look_again);
    if (choice) {
      read(*choice, lock);
    } else {
      changed_.wait_until(lock, look_again);
    }
  }
}

}  // namespace proofmass::coordinator
