#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/dispatch/run_set.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

/// Bounds of what is read of a campaign for people.
inline constexpr std::size_t page_events_max = 10'000;
inline constexpr std::size_t page_attempts_max = 5'000;
inline constexpr std::size_t page_losses_max = 1'000;
inline constexpr std::size_t page_given_up_max = 100;
/// Results that are read at a time: about 20 ms of a core.
inline constexpr std::uint64_t page_results_a_reading = 16'384;

/// Results that were read of a campaign database, a part at a time. Results never change: what was
/// read once stays, and only what has come since is read further. A copy costs little: memory is 17
/// kB a quantity.
class ResultsReading {
 public:
  /// Nothing is read yet.
  /// @throws StoreError, ConfigError as stored_campaign().
  explicit ResultsReading(const Store& store);

  /// Whether the file has the campaign that this was begun with, and not another one that has its
  /// place now.
  [[nodiscard]] bool is_of(const Store& store) const;

  /// Reads some `num_results_max` results at most that are in the file and were not read before;
  /// the next call goes on after them.
  /// @throws StoreError if the file cannot be read or is damaged.
  void read_further(const Store& store, std::uint64_t num_results_max);

  [[nodiscard]] std::uint64_t num_read() const { return read_.size(); }
  [[nodiscard]] CampaignStatistics statistics() const;

  /// A fragment of HTML for a page with review_style(): the accuracy table, that of standard errors
  /// if there are any, and the histograms of |error| of a review report. Headings are of level 3.
  [[nodiscard]] std::string html() const;

 private:
  ResultsReading(const Store& store, const Campaign& campaign);

  wire::CampaignId campaign_;
  Review review_;  ///< What tables are made of, but for the results.
  RunningStatistics statistics_;
  RunningStandardErrors standard_errors_;
  ErrorFigures figures_;
  RunSet read_;
  std::uint64_t next_run_ = 0;  ///< Where the next call begins.
};

/// What a campaign database has for people, as far as it was read.
struct CampaignDetails {
  std::deque<StoredEvent> events = {};  ///< In order; at most page_events_max.
  std::vector<LossCount> losses = {};
  std::vector<EndCount> ends = {};           ///< Without an estimate.
  std::vector<GivenUpRecord> given_up = {};  ///< At most page_given_up_max.
  RecentAttempts attempts = {};
  std::string html = {};                               ///< ResultsReading::html().
  std::uint64_t num_runs = 0;                          ///< Finished runs that were read for it.
  std::shared_ptr<const ResultsReading> reading = {};  ///< What the next reading goes on from.
  /// Why the last reading failed; the other members are those of the reading before it.
  std::string failure = {};
  TimePoint read_at{};  ///< When the last reading that did not fail began, or the first one.
};

/// How campaign databases are read: each time further than before, which is null at first.
using ReadDetails = std::function<CampaignDetails(const CampaignRecord&, const CampaignDetails*)>;

/// Reads a campaign database, as a coordinator and `run` want it: all but the results, and some of
/// those. A file that lacks what was read of it before is read anew from the beginning: it is an
/// older copy, or another campaign has its place.
[[nodiscard]] CampaignDetails read_details(const CampaignRecord& campaign,
                                           const CampaignDetails* before);

/// When a campaign is read again after a reading that ended at `ended_at` and took so much
/// processor time: not before 75 times that time. So reading takes 1.33 % of a core at most,
/// however many campaigns are looked at.
[[nodiscard]] TimePoint end_of_rest(TimePoint ended_at, Duration cpu_time);

/// Reads the databases of those campaigns at which somebody looks, in one thread of low priority.
/// A campaign that nobody has asked for in the last minute is not read, and forgotten if another
/// one needs its place.
class DetailReader {
 public:
  static constexpr std::chrono::seconds wanted_for{60};
  static constexpr std::size_t num_campaigns_max = 64;

  explicit DetailReader(ReadDetails read);
  ~DetailReader();  ///< Waits until what is being read is read.
  DetailReader(const DetailReader&) = delete;
  DetailReader& operator=(const DetailReader&) = delete;

  /// What was read of the campaign so far, null before the first reading; asks for more. Never
  /// waits. If too many others are wanted, it says so.
  [[nodiscard]] std::shared_ptr<const CampaignDetails> details(const CampaignRecord& campaign,
                                                               TimePoint now);

 private:
  struct Watched {
    CampaignRecord campaign;
    TimePoint asked_at;
    std::shared_ptr<const CampaignDetails> details;
    TimePoint due{};
  };

  void work();
  /// The name of the campaign that is to be read now, if any, and otherwise when to look again.
  [[nodiscard]] std::optional<std::string> choose(TimePoint now, TimePoint& look_again) const;
  void read(const std::string& name, std::unique_lock<std::mutex>& lock);
  /// @return Whether there is room for one more campaign.
  [[nodiscard]] bool make_room(TimePoint now);

  ReadDetails read_;
  std::mutex mutex_;  ///< For what follows.
  std::condition_variable changed_;
  std::map<std::string, Watched> watched_;  ///< By name.
  TimePoint rests_until_{};
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace proofmass::coordinator
