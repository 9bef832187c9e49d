#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/dispatch/run_set.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

using wire::Attempt;
using wire::CampaignId;
using wire::LossReason;
using wire::SessionId;
using wire::WorkerId;

/// A monotonic time, handed in by the caller: nothing in the dispatch reads a clock.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

[[nodiscard]] inline double seconds(Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// A duration computed from times that workers report, which may be any: 1e6 s at most.
[[nodiscard]] inline Duration bounded_duration(double duration_s) {
  constexpr double duration_s_max = 1e6;
  return std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(std::min(duration_s, duration_s_max)));
}

/// A computer, by what its workers cannot choose. What they say, and their crashes, count for it
/// alone, whatever they call themselves.
struct HostId {
  std::string key;      ///< Public key of the workers; empty without keys.
  std::string address;  ///< Of their connections, as the coordinator sees it.
  auto operator<=>(const HostId&) const = default;
};

struct DispatchConfig {
  Duration heartbeat_interval = std::chrono::seconds(5);  ///< Asked of every worker.
  Duration suspect_after = std::chrono::seconds(15);  ///< Of silence; then nothing more is lent.
  Duration lost_after = std::chrono::seconds(60);     ///< Of silence; then runs are lent again.
  /// `lost_after` while the coordinator is behind with reading: what seems silent may wait to be
  /// heard.
  Duration lost_after_if_behind = std::chrono::minutes(10);
  /// Runs that a heartbeat does not list, this long after they were lent, did not arrive. Longer
  /// than a message and its answer ever take while the worker is not suspect.
  Duration arrival_max = std::chrono::seconds(12);
  /// Of a lease before a run time is known: then its runs are copied to idle workers.
  Duration lease_duration_max = std::chrono::minutes(2);
  double lease_work_s = 1.5;  ///< Work that a slot is lent at a time, once run times are known.
  /// Processors' slots of all workers that are known to come: the first ones to register then leave
  /// the others their part of a small campaign.
  std::uint64_t num_slots_expected = 0;
  /// Runs of a campaign that are lent or on their way to the store: near that many, workers get no
  /// more than two rounds; with half of it on the way to the store, nothing. A disk that is slower
  /// than the workers must not fill the memory.
  std::uint64_t uncommitted_max = 100'000;
  /// Results that all workers together may be expected to deliver. Where they are faster, they hold
  /// less than two rounds: what two take at this rate, or `uncommitted_max`. Results that arrive
  /// faster than they can be stored delay heartbeats, and workers send them again.
  double results_per_s_max = 30'000.0;
  /// Assumed time of a run until a campaign's first result says what a run takes.
  double run_time_s_expected = 5.0;
  /// A batch that finishes no step for this many times the usual time of one, and for at least
  /// `hung_after_min`, hangs.
  double hung_after_steps = 50.0;
  Duration hung_after_min = std::chrono::seconds(60);
  std::uint32_t crashes_per_run_max = 3;  ///< A run that crashed so many workers is given up.
  /// A run that one host alone saw crash waits so long from its last attempt on for another host
  /// that may try it; once there is one, until it does.
  Duration lone_witness_wait = std::chrono::minutes(5);
  /// In a row, without a finished run; then quarantine. Likewise of a campaign at a worker.
  std::uint32_t crashes_per_host_max = 5;
  Duration quarantine_duration = std::chrono::minutes(10);
  /// After a start with workers that should still be attached, nothing is lent until all of them
  /// have said what they hold, or until this has passed.
  Duration reattach_wait = std::chrono::seconds(15);
  std::size_t num_workers_max = 4096;
  std::size_t hosts_per_key_max = 4096;  ///< Remembered; those with workers are not forgotten.
  double hellos_per_s_max = 500.0;       ///< More are not answered; workers repeat them.
  /// Of the built-in model, as this coordinator computes it.
  std::uint64_t reference_digest = 0;
};

/// What must be the same where the runs of a campaign are computed.
struct ModelIdentity {
  std::string version;                 ///< Model::version().
  std::uint64_t reference_digest = 0;  ///< Model::reference_digest().
  /// Model::description_digest(): the same also where another reference digest is tolerated.
  std::uint64_t description_digest = 0;
};

/// A batch that a worker computes, and since when it has come no further.
struct Progress {
  CampaignId campaign;
  RunSet runs;
  std::uint32_t num_steps_done = 0;
  TimePoint advanced_at;
};

/// What a worker's cards have done for a campaign since they were last idle.
struct CardWork {
  TimePoint since;
  std::uint64_t num_results = 0;
  double rate = 0.0;        ///< Runs a second; 0 if not known yet.
  bool can_compute = true;  ///< Until processors compute what was lent to cards.
};

struct Worker {
  SessionId session;
  std::string name;
  HostId host;
  std::string host_name;  ///< As the worker gave it.
  std::uint64_t process_id = 0;
  std::uint32_t num_slots = 1;
  std::uint32_t num_card_slots = 0;    ///< Among these.
  std::uint32_t slots_per_thread = 0;  ///< Of processors; 0 if each run takes one.
  std::string cards;                   ///< What they are, as the worker says.
  std::vector<ModelIdentity> models;
  TimePoint registered_at;
  TimePoint heard_at;                    ///< Last message of any kind.
  std::uint64_t heartbeat_sequence = 0;  ///< Of the newest heartbeat.
  TimePoint heartbeat_at;                ///< When the newest heartbeat arrived.
  std::uint32_t num_runs_max = 0;       ///< Its credit: most unfinished runs that it wants to hold.
  std::uint64_t num_lent = 0;           ///< Runs on its leases, as far as the coordinator knows.
  std::uint64_t num_lent_to_cards = 0;  ///< Among these.
  /// Of its processors' leases; more than slots if runs wait there.
  std::uint64_t num_slots_lent_for = 0;
  /// Whether it may be lent runs, as the last tick or the last attempt to lend it some found it.
  bool is_eligible = false;
  std::uint64_t num_steps_done = 0;
  std::uint64_t num_results = 0;
  std::set<CampaignId> joined;      ///< Campaigns whose files know it.
  std::vector<Progress> computing;  ///< As the newest heartbeat has it.
  std::set<LeaseId> leases;
  std::uint64_t num_alone = 0;  ///< Suspects on its leases; nothing else is lent with one.
  /// Open runs that it holds though they are not lent to it, as the newest heartbeat has it.
  std::map<CampaignId, RunSet> unleased;
  /// Finished runs whose results could not be taken (NotServed), as the newest heartbeat has it.
  std::map<CampaignId, std::map<Attempt, RunSet>> set_aside;
  /// Until then it may get runs that were taken off its leases: a heartbeat without them proves
  /// nothing.
  TimePoint clear_at;
  TimePoint retracted_at;  ///< When runs were last asked back for idle workers, ...
  int num_retracts = 0;    ///< ... and how often since it last gave some back or delivered one.
  /// Running mean of what a run takes in its slot, by campaign; nothing if not known yet.
  std::map<CampaignId, double> run_time_s;
  /// What its cards do for a campaign; nothing before it was lent to them.
  std::map<CampaignId, CardWork> card_work;
};

[[nodiscard]] constexpr std::uint32_t num_processor_slots(const Worker& worker) {
  return worker.num_slots - worker.num_card_slots;
}

/// Why runs are lent. Only the runs of `first` leases count as open; the others are extra.
enum class LeaseKind : std::uint8_t {
  first,  ///< To be computed.
  copy,   ///< Of a run that another worker seems to be too slow with.
  audit,  ///< Of a run that is stored: to be compared with it.
};

/// Runs lent to a worker at a time. It exists while one of them has not been delivered.
struct Lease {
  CampaignId campaign;
  WorkerId worker;
  Attempt attempt;
  Attempt known_as;  ///< Attempt by which the worker names it; older if it held the runs before.
  LeaseKind kind = LeaseKind::first;
  bool is_alone = false;      ///< Of one run, which is suspected.
  bool is_for_cards = false;  ///< Otherwise for processors.
  bool is_retracted = false;  ///< The worker is asked, at each heartbeat, to give back what it can.
  bool is_adopted = false;    ///< Held before it was lent: when it began is not known.
  std::uint64_t num_runs = 0;       ///< In `remaining` when it was opened.
  std::uint64_t slots_per_run = 1;  ///< slots_per_run() of worker and campaign.
  /// Slots that these were lent for: at least slots_per_run a run, and more for the last runs of a
  /// campaign.
  std::uint64_t num_slots = 0;
  RunSet remaining;
  TimePoint lent_at;
};

/// Slots that the remaining runs of a lease take.
[[nodiscard]] std::uint64_t num_slots_taken(const Lease& lease);

/// Slots of a worker's processors for which no runs are lent to it.
[[nodiscard]] constexpr std::uint64_t num_idle_slots(const Worker& worker) {
  const std::uint64_t num_slots = num_processor_slots(worker);
  return num_slots - std::min(num_slots, worker.num_slots_lent_for);
}

/// Whether a campaign's runs are lent.
using Phase = wire::CampaignPhase;

/// True if no run of such a campaign is lent.
[[nodiscard]] constexpr bool has_ended(Phase phase) {
  return phase == Phase::finished || phase == Phase::cancelled;
}

/// What speaks against a run.
struct Suspicion {
  /// Crashes on one host, those among them in which the worker computed nothing else, and how often
  /// the run was lent there alone.
  struct OnHost {
    std::uint32_t num_crashes = 0;
    std::uint32_t num_alone = 0;
    std::uint32_t num_lent_alone = 0;
  };
  std::uint32_t num_crashes = 0;
  std::map<HostId, OnHost> hosts;  ///< Of the present epoch.
  TimePoint tried_at{};            ///< When it was last lent alone.
};

/// What speaks against computing a campaign at a worker: crashes outside its process.
struct OutsideCrashes {
  std::uint32_t num_in_a_row = 0;              ///< Without a finished run of the campaign.
  std::optional<TimePoint> paused_until = {};  ///< Until then no run of it is lent to the worker.
};

/// A result on its way to the store, with the workers that wait for the acknowledgement; the first
/// one's result is stored.
struct Uncommitted {
  Attempt attempt;
  std::vector<WorkerId> waiting;
  bool is_kept = false;  ///< See CampaignState::num_kept.
};

/// Leases of a run besides the first one.
struct Copies {
  std::vector<LeaseId> leases;  ///< At most two; none if all were lost.
  Attempt newest;               ///< Highest attempt under which the run has been lent.
};

/// Where runs to be audited come from: another worker is to compute them.
struct AuditKey {
  WorkerId first_worker;  ///< 0 if not known.
  Attempt attempt;        ///< Under which they will be lent.
  auto operator<=>(const AuditKey&) const = default;
};

/// One campaign. Each of its runs is in exactly one of `pending`, `pending_suspects`, `lent`,
/// `delivered`, `committed`, `given_up` and `elsewhere`. All other fields can be found by walking
/// the leases, or count.
struct CampaignState {
  std::shared_ptr<const Campaign> definition;  ///< Shared with messages under way.
  ModelIdentity model;
  std::string model_refusal;  ///< Why the last worker with another one of this version has none.
  Phase phase = Phase::active;
  int priority = 0;                   ///< Runs of a higher one are lent first.
  double audit_fraction = 0.0;        ///< Of its runs, computed a second time, by another worker.
  std::map<Attempt, RunSet> pending;  ///< By the attempt under which they will be lent.
  std::map<RunIndex, Attempt> pending_suspects;  ///< Pending ones that are to be lent alone.
  LeaseIndex lent;                               ///< Runs on first leases.
  std::map<RunIndex, Uncommitted> delivered;     ///< Handed to the store, not committed yet.
  RunSet committed;
  RunSet given_up;
  RunSet elsewhere;  ///< Not lent here, as another coordinator computes them; taken if they come.
  std::map<RunIndex, Suspicion> suspects;               ///< Open runs that were blamed for a crash.
  std::map<SessionId, OutsideCrashes> outside_crashes;  ///< At registered workers.
  std::map<RunIndex, Copies> copies;                    ///< Of runs in `lent`, once there was one.
  std::map<AuditKey, RunSet> to_audit;                  ///< Committed, and not lent for audit yet.
  std::uint64_t num_to_audit = 0;                       ///< Runs in `to_audit`.
  LeaseIndex audits;                                    ///< Runs on audit leases.
  std::map<RunIndex, std::uint32_t> audit_crashes;      ///< Of runs in `to_audit` or `audits`.
  std::uint64_t num_comparing = 0;                      ///< Results on their way to be compared.
  double run_time_s = 0.0;               ///< Running mean over all workers; 0 if not known yet.
  std::string storage_failure;           ///< Why nothing can be stored; empty if all is well.
  std::uint64_t num_committed_here = 0;  ///< Without those that were finished before.
  std::uint64_t num_kept = 0;  ///< Of these, those that workers had finished while cut off.
  std::uint64_t num_without_estimate = 0;  ///< Delivered here, with a status that has none.
  std::uint64_t num_duplicates = 0;        ///< Results that were there already.
  std::uint64_t num_audited = 0;           ///< Results that were compared with the stored ones.
  std::uint64_t num_mismatches = 0;        ///< Compared results that differ from the stored ones.
};

/// A campaign as the store has it when the coordinator starts.
struct StoredCampaign {
  std::shared_ptr<const Campaign> definition;
  /// Of its model, where it began; 0 for the coordinator's own.
  std::uint64_t reference_digest = 0;
  CampaignControl control = {};
  std::vector<RunRange> finished = {};
  std::vector<RunRange> given_up = {};
  std::vector<RunRange> elsewhere = {};  ///< Unfinished runs that are not to be lent here.
  std::vector<RunRange> compared = {};   ///< Finished runs of which a second result was compared.
  std::uint64_t num_audited = 0;         ///< Compared by coordinators before, of CampaignState.
  std::uint64_t num_mismatches = 0;      ///< Likewise.
  std::vector<BlamedRun> blamed = {};    ///< Open runs.
};

/// A computer with workers, or with a history.
struct Host {
  std::string name;               ///< As its first worker gave it; for people.
  std::uint32_t num_workers = 0;  ///< Registered.
  std::uint32_t num_crashes = 0;  ///< Since one of its workers last delivered a result.
  std::uint64_t num_results = 0;
  TimePoint left_at;  ///< Its last worker was heard then, if it has none.
  /// Running mean of what a step takes in its slot, by campaign; nothing if not known yet.
  std::map<CampaignId, double> step_time_s = {};
};

/// Slots for which runs were lent, and when; at most so many times.
class LentSlots {
 public:
  void add(TimePoint now, std::uint64_t num_slots);
  void forget_before(TimePoint time);
  [[nodiscard]] std::uint64_t num_slots() const { return num_slots_; }

 private:
  void forget_first();

  static constexpr std::size_t times_max = 8192;
  std::deque<std::pair<TimePoint, std::uint64_t>> lent_;  ///< In the order of time.
  std::uint64_t num_slots_ = 0;
};

/// All that the dispatch knows. Only the events change it: the functions
/// on_...() of events.hpp.
struct State {
  DispatchConfig config;
  std::map<CampaignId, CampaignState> campaigns;
  /// Campaigns that are known to be finished or cancelled although they are not served, with their
  /// number of runs: workers may forget them. All others that are not served may be served later.
  std::map<CampaignId, std::uint64_t> ended;
  std::vector<CampaignId> order;   ///< In which they were added.
  std::vector<CampaignId> served;  ///< Active ones, in the order in which their runs are lent.
  std::map<WorkerId, Worker> workers;
  std::map<LeaseId, Lease> leases;
  std::uint64_t next_lease = 1;
  std::uint64_t num_slots = 0;           ///< Of all workers.
  std::uint64_t num_eligible_slots = 0;  ///< Of the processors of eligible workers.
  std::uint64_t num_idle_slots = 0;      ///< Slots of eligible workers' processors that are idle.
  std::uint64_t num_slots_expected = 0;  ///< Of processors of workers that are still to come.
  LentSlots lately_lent;      ///< What was longer ago than half of a run takes may be missing.
  std::set<WorkerId> hungry;  ///< Workers that were lent less than they would take.
  WorkerId fed_last;          ///< The hungry worker that was last lent runs.
  std::map<HostId, Host> hosts;
  /// Hosts that are lent nothing until then, but for one round to workers that have delivered.
  std::map<HostId, TimePoint> quarantined;
  std::uint64_t num_refusals = 0;  ///< Of workers that wanted to register.
  std::string last_refusal;        ///< `NAME: reason`.
  TimePoint refused_at{};
  /// Sessions that should be attached and have not said yet what they hold.
  std::set<SessionId> awaited;
  TimePoint awaited_until{};
  /// Sessions that were lent runs before this coordinator started: which, is not known.
  std::set<SessionId> attached;
  std::set<SessionId> absent;  ///< Of these, those that have not registered since.
  /// Runs that were taken off the leases of a session, which it may still hold; of
  /// `num_workers_max` sessions at most.
  std::map<SessionId, std::map<CampaignId, RunSet>> lent_before;
  TimePoint ticked_at{};       ///< About now.
  TimePoint finished_at{};     ///< When a run last finished, or was said to be long ago.
  TimePoint attended_since{};  ///< There has been a worker since then.
  bool is_lending = true;      ///< False once the service ends, ...
  bool is_stopped = false;     ///< ... and this is true if it does not even wait for results.
  /// Messages of workers have arrived that have not been handled. Set by the caller: then silence,
  /// and what heartbeats do not say, proves little.
  bool is_behind = false;
  double hello_allowance = 0.0;
  TimePoint hello_allowance_at{};
};

/// A coordinator without campaigns.
/// @param awaited  Sessions that were attached when the coordinator before this one ended.
[[nodiscard]] State initial_state(const DispatchConfig& config, std::set<SessionId> awaited,
                                  TimePoint now);

/// Runs that nothing more is expected of: they are durably stored, given up or computed elsewhere.
[[nodiscard]] std::uint64_t num_settled(const CampaignState& campaign);

/// True if every run is settled, and every audit done.
[[nodiscard]] bool is_finished(const CampaignState& campaign);

/// True if who has the model computes runs of the campaign, or others that it tolerates.
[[nodiscard]] bool is_accepted(const ModelIdentity& model, const CampaignState& campaign);

[[nodiscard]] bool has_model(const Worker& worker, const CampaignState& campaign);

/// True if the worker may be lent runs of the campaign: it has the model, and what simulates does
/// not crash there again and again.
[[nodiscard]] bool can_compute(const Worker& worker, const CampaignState& campaign);

/// True if there are workers, and none of them has the model of a campaign that is to go on.
[[nodiscard]] bool lacks_workers(const State& state, const CampaignState& campaign);

/// True if a campaign that is to go on crashes at all workers that have its model.
[[nodiscard]] bool crashes_everywhere(const State& state, const CampaignState& campaign);

/// Slots of its processors that a worker needs for a run: more than one if a thread has more than
/// the runs that the model computes together.
[[nodiscard]] std::uint64_t slots_per_run(const Worker& worker, const CampaignState& campaign);

/// True if no run of the campaign waits or is lent: all results have come.
[[nodiscard]] bool expects_no_result(const CampaignState& campaign);

/// True if no result is expected or on its way to the store any more.
/// @param lost  Campaigns of which nothing can be stored any more.
[[nodiscard]] bool is_quiet(const State& state, const std::set<CampaignId>& lost = {});

/// True if workers on a host of this name, with whatever key, are lent nothing.
[[nodiscard]] bool is_quarantined(const State& state, const std::string& host);

/// Runs on the worker's leases, of all campaigns, as text for logs.
[[nodiscard]] std::string runs_held_text(const State& state, WorkerId worker);

/// True if these losses count against the runs that were being computed.
[[nodiscard]] bool is_blamed(LossReason reason);

/// The mean of about the last ten values, with one more.
/// @param mean  Before it; 0 if there was no value yet.
[[nodiscard]] double running_mean(double mean, double value);

/// True if the run is one of the fraction that is audited: a pure function, the same after a
/// restart.
[[nodiscard]] bool is_audited(std::uint64_t campaign_seed, RunIndex run, double fraction);

}  // namespace proofmass::coordinator
