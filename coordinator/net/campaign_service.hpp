#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/store/store_writer.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// The time in which this process was awake. A process that was stopped or waited for a disk has
/// not heard its workers meanwhile, and that must not count as their silence.
class WakingTime {
 public:
  /// @param began_at  Of the steady clock, as all times here.
  explicit WakingTime(TimePoint began_at) : asked_at_(began_at) {}

  /// The time. What exceeds `gap_max` between two calls is left out.
  /// @param steady  Not before the one of any earlier call.
  [[nodiscard]] TimePoint at(TimePoint steady) {
    const Duration gap = steady - asked_at_;
    if (gap > gap_max) slept_ += gap - gap_max;
    asked_at_ = steady;
    return steady - slept_;
  }

  /// Several times the longest time between two calls of a process that is awake.
  static constexpr std::chrono::milliseconds gap_max{500};

 private:
  TimePoint asked_at_;
  Duration slept_{};
};

/// How fast runs have been stored in the last two minutes, while any were lent. Results that
/// workers had kept from before, which arrive all at once, are not to be added.
class RateMeter {
 public:
  explicit RateMeter(TimePoint began_at) : asked_at_(began_at) {}

  /// Runs were lent since the last call of this or of wait(), and some are stored.
  /// @param now  Not before any earlier one.
  void add(std::uint64_t num_runs, TimePoint now) {
    if (counts_.empty() || now - counts_.back().began_at >= std::chrono::seconds(1)) {
      counts_.push_back({.began_at = asked_at_, .lent_for = {}, .num_runs = 0});
    }
    counts_.back().num_runs += num_runs;
    counts_.back().lent_for += now - asked_at_;
    while (now - counts_.front().began_at > window_) counts_.pop_front();
    asked_at_ = now;
  }

  /// None was lent.
  void wait(TimePoint now) { asked_at_ = now; }

  /// Runs per second; 0 if none was stored lately.
  [[nodiscard]] double rate_hz(TimePoint now) const {
    Duration lent_for{};
    std::uint64_t num_runs = 0;
    for (const Count& count : counts_) {
      if (now - count.began_at > window_) continue;
      num_runs += count.num_runs;
      lent_for += count.lent_for;
    }
    const double lent_for_s = std::chrono::duration<double>(lent_for).count();
    return lent_for_s > 0.0 ? static_cast<double>(num_runs) / lent_for_s : 0.0;
  }

 private:
  static constexpr std::chrono::seconds window_{120};

  /// What was stored in a second from `began_at` on.
  struct Count {
    TimePoint began_at;
    Duration lent_for;  ///< The part of it in which runs were lent.
    std::uint64_t num_runs = 0;
  };

  TimePoint asked_at_;
  std::deque<Count> counts_;
};

/// The campaigns of a coordinator, from the first look at a file to the archive. Keeps in the files
/// what must outlive the process. Status comes from memory alone; what may wait for a disk is done
/// in the background.
///
/// Each database is in one of these states:
///
///     state     what it is                                  next state
///     unserved  a file of the directory that cannot be      any, at the next look; gone
///               served for now; tried again every 5 s
///     served    open; the dispatch lends its runs           settled
///     settled   open; finished or cancelled, and all is     served by submit, resume, retry or the
///               stored that followed from it                stop rule; closing if 16 others are
///                                                           settled since then, or by archive
///     closing   held, until its log is folded in            closed; settled if somebody reads it
///     closed    a line of the list; the file is complete    served by submit, resume, retry;
///               and has no lock, log or descriptor          any if the file changes; archived;
///               gone
///     archived  moved to where nothing is served            -
///     gone      removed by somebody                         any if it comes back
class CampaignService {
 public:
  explicit CampaignService(const ServiceContext& context);
  ~CampaignService();  ///< Waits for statistics that are being computed.
  CampaignService(const CampaignService&) = delete;
  CampaignService& operator=(const CampaignService&) = delete;

  /// Begins to serve a campaign, one that has ended before perhaps, or lists one that has ended.
  /// @throws Error if one of that name or number is there already.
  void add(FileLook look);
  /// add() for a file of the directory: if that is not possible, it waits and is looked at again.
  void take(FileLook look);

  /// The campaign of that name as it stands.
  [[nodiscard]] std::optional<CampaignRecord> find(std::string_view name) const;
  [[nodiscard]] bool is_served(CampaignId id) const { return served_.contains(id); }
  /// Unfinished campaigns of an owner, and the bytes of their definitions.
  struct Holdings {
    std::size_t num_campaigns = 0;
    std::uint64_t size = 0;
  };
  [[nodiscard]] Holdings holdings_of(std::string_view owner) const;
  /// What a campaign has of those of its owner: nothing if it is finished or cancelled.
  [[nodiscard]] Holdings holdings_of(CampaignId id) const;

  /// Changes a served campaign, which is kept meanwhile from being closed, or changed by a stop
  /// rule.
  /// @param change  Of its file, in the background; if it throws, that is the reply.
  /// @param finish  What follows from it here.
  /// @return False if too much work is pending: nothing is done.
  /// @throws Error if another request is changing it, or if nothing can be stored.
  [[nodiscard]] bool change_held(CampaignId id, std::function<void()> change,
                                 std::function<void()> finish, Respond respond);
  /// Nothing can be stored any more in the file of this campaign: nothing of it is left to do.
  void abandon(CampaignId id) { served_.at(id).is_abandoned = true; }
  [[nodiscard]] std::set<CampaignId> abandoned() const;
  [[nodiscard]] bool is_held(CampaignId id) const { return served_.at(id).is_held; }
  /// True while the statistics of a campaign are being computed, or will be at once as it has
  /// ended. Those that could not be stored are not waited for.
  [[nodiscard]] bool awaits_summary(CampaignId id) const;
  /// What follows from a change of a served campaign's file.
  /// @param definition  As its file has it now.
  /// @param wishes      Priority and audit fraction are looked at; if unset, they stay.
  void change(CampaignId id, std::shared_ptr<const Campaign> definition, const StopPlan& plan,
              const proto::SubmitRequest& wishes);
  // Of a served campaign.
  [[nodiscard]] const StopPlan& plan_of(CampaignId id) const { return served_.at(id).plan; }
  [[nodiscard]] std::uint64_t num_runs_of(CampaignId id) const {
    return state_.campaigns.at(id).definition->num_runs;
  }

  /// What the file of a served campaign is to have after an action.
  /// @param priority  For set_priority.
  [[nodiscard]] CampaignControl control_after(CampaignId id, proto::ControlAction action,
                                              int priority) const;
  /// Carries out an action.
  /// @param stored  Its control_after(), which is stored by now, for retry after RetriedRuns.
  void control(CampaignId id, proto::ControlAction action, const CampaignControl& stored);
  [[nodiscard]] proto::ReplyEnvelope done_reply(CampaignId id) const;

  /// Takes a campaign that is finished or cancelled from the list and moves its file to where it is
  /// not served.
  /// @param respond  Called when that is done, or with the reason why it is not.
  /// @throws Error if results are still to be stored, statistics to be computed, or another request
  ///         is changing it.
  void archive(CampaignId id, const Respond& respond);

  /// Follows what the dispatch did: measures rates, stores phases, brings the statistics of
  /// campaigns that have ended up to date. To be called several times a second.
  void review();
  /// Looks at the directory if it is time. To be called some times a second.
  void review_directory();

  [[nodiscard]] CampaignRecord record_of(CampaignId id) const;
  /// At most `count_max` campaigns from the index `first` on, in the order in which they came.
  [[nodiscard]] std::vector<CampaignRecord> records(
      std::size_t first = 0, std::size_t count_max = std::numeric_limits<std::size_t>::max()) const;
  [[nodiscard]] std::size_t num_campaigns() const { return order_.size(); }
  /// Adds the files that cannot be served for now, by name, as many as a reply may have.
  void add_unserved(proto::StatusReply& reply) const;

  /// True if nobody waits to be told of the end of a campaign, see ServiceConfig::on_notice.
  [[nodiscard]] bool is_all_told() const;

  /// True if every campaign is finished, cancelled or abandoned.
  [[nodiscard]] bool is_all_done() const;
  /// True if no file waits to be served; copies of served campaigns do not count. An unfinished
  /// campaign waits whose model this program does not have.
  [[nodiscard]] bool is_all_served() const;

  /// Ends the service of all campaigns and gives the files that are open back, in the order in
  /// which they came.
  [[nodiscard]] std::vector<ServedCampaign> close();

 private:
  /// Runs that were committed here, and those that are given up.
  using Counts = std::pair<std::uint64_t, std::uint64_t>;

  /// What is known of a campaign beside the dispatch's state.
  struct Served {
    CampaignRecord record;  ///< Without what changes; see record_of().
    RateMeter rate;
    std::uint64_t num_computed_seen = 0;
    CampaignControl written;  ///< As the file has it.
    StopPlan plan;
    bool is_decided = false;                ///< The stop rule was checked with the runs of now.
    std::uint64_t num_failures_before = 0;  ///< Runs without an estimate, when it came.
    bool is_at_rest = false;                ///< Nothing is expected: the log is folded in.
    // What ServiceConfig::on_notice was called with.
    bool is_end_told = false;
    std::string trouble_told = {};             ///< Empty if all is well.
    std::optional<TimePoint> ended_at = {};    ///< Nothing is left to do since then.
    std::optional<TimePoint> closing_at = {};  ///< When closing was tried last, in vain.
    bool is_held = false;                      ///< See change_held().
    bool is_abandoned = false;                 ///< See abandon().
    bool is_summary_due = false;               ///< As the last one failed, or the file lacks them.
    bool is_of_all = false;              ///< The last statistics, as the campaign was finished.
    Counts summarised = {};              ///< Of the last statistics.
    std::string summary_failure = {};    ///< Of the last statistics; empty if there was none.
    std::string extension_failure = {};  ///< Of the last extension by the stop rule.
    TimePoint summary_after = {};        ///< When statistics may be computed next.
    std::future<std::optional<std::uint64_t>> summary;  ///< See CampaignFiles::summarise().
  };

  /// What came of looking at the directory.
  struct Findings {
    std::vector<CampaignRecord> changed;  ///< Closed files that are other ones now.
    std::vector<FileLook> looks;
  };

  // From state to state.
  void serve(FileLook look);
  /// Takes a campaign from the list of those whose files are closed.
  void unlist(CampaignId id);
  [[nodiscard]] KnownCampaigns known() const;
  void take_findings(Findings findings);

  /// All runs of now are there, and its stop rule is still to be checked with them.
  [[nodiscard]] bool is_undecided(CampaignId id) const;
  /// As shown and stored: a campaign that is undecided, or has runs elsewhere, is not finished.
  [[nodiscard]] Phase phase_of(CampaignId id) const;
  void extend(CampaignId id, std::shared_ptr<const Campaign> definition);
  /// Runs without an estimate, those that were given up among them.
  [[nodiscard]] static std::uint64_t num_failures_of(const CampaignState& campaign,
                                                     const Served& served);
  [[nodiscard]] static bool has_too_many_failures(const CampaignState& campaign,
                                                  const Served& served);
  void review_failures(CampaignId id, const Served& served);
  [[nodiscard]] CampaignControl control_now(CampaignId id) const;
  void review_control(CampaignId id, Served& served);
  void review_notices(CampaignId id, Served& served);
  /// @param failure  Empty if the campaign is finished.
  void tell(const Served& served, std::string failure) const;
  [[nodiscard]] static Counts counts_of(const CampaignState& campaign);
  /// True if a campaign has ended, and its statistics are still to be made.
  [[nodiscard]] bool lacks_summary(CampaignId id, const Served& served) const;
  void review_summary(CampaignId id, Served& served);
  void take_summary(CampaignId id, Served& served);
  void go_on_to(CampaignId id, std::uint64_t num_runs);
  void begin_summary(CampaignId id, Served& served);
  /// True if no result is on its way, no statistics are to be computed, and nobody changes it.
  [[nodiscard]] bool expects_nothing(CampaignId id, const Served& served) const;
  /// True if nothing of the campaign is to be stored or computed, and nobody changes it.
  [[nodiscard]] bool is_settled(CampaignId id, const Served& served) const;
  /// True if the campaign is finished, its statistics are there, and nothing is under way.
  [[nodiscard]] bool is_finished_and_settled(CampaignId id, const Served& served) const;
  void close_surplus(std::vector<CampaignId> ended, TimePoint now);
  void review_rest(CampaignId id, Served& served);
  /// Closes the file if it is still settled when its log is folded in, and nobody reads it.
  /// @param then  Called with true when the closing is under way, with false if it is not.
  void begin_closing(CampaignId id, std::function<void(bool is_closing)> then);
  void move_to_archive(CampaignId id, const Respond& respond);
  void close_ended(CampaignId id);
  void say_not_closed(std::string_view reason);

  const ServiceContext& context_;
  State& state_;
  StoreWriter& writer_;
  Outbox& outbox_;
  CampaignFiles* files_;
  std::map<CampaignId, Served> served_;
  std::map<CampaignId, CampaignRecord> closed_;
  std::vector<CampaignId> order_;  ///< Of served and closed campaigns, as they came.
  std::map<std::filesystem::path, FileLook> unserved_;
  TimePoint looked_at_;  ///< At the directory.
  bool is_looking_ = false;
};

}  // namespace proofmass::coordinator
