#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/runs.hpp"
#include "core/statistics/stop_rule.hpp"
#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {

/// What a StoreError says first of a file that nothing more can be written to.
inline constexpr std::string_view disk_full_text = "the disk is full";

/// A campaign database cannot be used as asked; reads `campaign database = path (what is wrong)`.
class StoreError : public Error {
 public:
  using Error::Error;
};

// What goes into a campaign database, and what comes back when a coordinator starts.

/// A result and where it comes from.
struct Delivery {
  RunResult result;
  wire::SessionId worker;
  wire::Attempt attempt;   ///< Under which the run was computed.
  double compute_s = 0.0;  ///< Time of a thread of the worker: the run's share of its batch.
};

/// A second result of a run that is stored: to be compared, and not to be kept.
struct SecondDelivery {
  Delivery delivery;
};

/// Runs that came back without a result.
struct ReturnedRuns {
  RunRange runs;
  wire::Attempt attempt;
  wire::SessionId worker;
  wire::LossReason reason = wire::LossReason::silent;
  bool is_blamed = false;  ///< It counts against these runs.
};

/// A run that crashed too many workers. A result that comes later all the same takes its place.
struct GivenUpRun {
  RunIndex run;
};

/// A line of the campaign's log.
struct EventEntry {
  std::string kind;  ///< What happened, in one word: `coordinator_started`.
  std::string text;  ///< Details; what is beyond 2,000 characters is cut.
  /// When it happened: the entry may wait for the disk.
  std::chrono::system_clock::time_point time = std::chrono::system_clock::now();
};

[[nodiscard]] inline EventEntry entry_of(const wire::Event& event) {
  return {.kind = std::string(event.kind), .text = to_text(event.fields)};
}

/// A worker process that is registered. Registering again changes nothing but the missing end.
struct WorkerJoined {
  wire::SessionId session;
  std::string name;
  std::string host;
  std::uint64_t process_id = 0;
  std::uint32_t num_slots = 1;
  std::string cards{};  ///< `2 NVIDIA H100 80GB HBM3 (CUDA 13.0)`; empty: none.
};

/// A worker that is registered no more.
struct WorkerEnded {
  wire::SessionId session;
  wire::LossReason reason = wire::LossReason::silent;
};

/// How a campaign is to be served; kept for the next coordinator.
struct CampaignControl {
  wire::CampaignPhase phase = wire::CampaignPhase::active;
  int priority = 0;             ///< -100 to 100; runs of a higher one are lent first.
  double audit_fraction = 0.0;  ///< Of the runs, computed a second time; 0 to 1.

  bool operator==(const CampaignControl&) const = default;
};

/// All runs that were given up are open again.
struct RetriedRuns {};

/// One thing to be written to a campaign database.
using Entry = std::variant<Delivery, SecondDelivery, ReturnedRuns, GivenUpRun, RetriedRuns,
                           EventEntry, WorkerJoined, WorkerEnded, CampaignControl>;

/// A coordinator process that begins to serve a campaign.
struct CoordinatorStart {
  wire::Epoch epoch;
  std::string host;
  std::uint64_t process_id = 0;
  std::string version;  ///< Of the program.
};

/// A run without a result that was computed when workers crashed.
struct BlamedRun {
  RunIndex run;
  std::uint32_t num_crashes = 0;
  wire::Attempt attempt;  ///< The largest under which it was lost so.

  bool operator==(const BlamedRun&) const = default;
};

/// What came of comparing a second result with the stored one.
struct Comparison {
  RunIndex run;
  wire::SessionId worker;  ///< Who delivered the second result.
  bool is_equal = false;   ///< Every bit that means something.

  bool operator==(const Comparison&) const = default;
};

/// Workers of one machine that computed runs of a campaign.
struct HostShare {
  std::string host;  ///< As it named itself.
  std::uint64_t num_workers = 0;
  std::uint64_t num_results = 0;
  double compute_s = 0.0;  ///< Time of threads: a processor core's or a card's.
  /// Time from the first registration of one of its workers to its last result, s; 0 without one.
  double serving_s = 0.0;
  std::string cards;  ///< As its workers say, each text once; empty: none.
};

/// Losses of one kind: runs that came back without a result, and were lent again.
struct LossCount {
  std::string reason;
  std::uint64_t num_losses = 0;  ///< Ranges of runs.
  std::uint64_t num_runs = 0;
  std::uint64_t num_blamed = 0;  ///< Losses that count against their runs.
};

/// How a campaign was computed, as far as its database keeps it.
struct CampaignExecution {
  std::uint64_t num_coordinators = 0;  ///< Starts of one.
  std::uint64_t num_workers = 0;
  std::uint64_t num_hosts = 0;
  double compute_s = 0.0;         ///< Of the results that were kept: from their begin to their end.
  std::uint64_t num_retried = 0;  ///< Results that were kept of a later attempt than the first.
  std::uint64_t num_audited = 0;  ///< Results that were compared with a second one.
  std::string first_result_utc{};  ///< Empty if there is none.
  std::string last_result_utc{};
  std::vector<HostShare> hosts{};  ///< At most 20, those with the most results first.
  /// By reason and whether they are blamed, the one with the most runs first.
  std::vector<LossCount> losses{};
};

/// When a campaign ends before all of its runs are finished.
struct StopPlan {
  std::string stop_rule;                      ///< `std(gain) within 5%`; empty: none.
  std::optional<std::uint64_t> num_runs_max;  ///< However far the rule is from being reached; > 0.
  std::optional<std::uint64_t> failures_max;  ///< Runs without an estimate, above which it stops.

  bool operator==(const StopPlan&) const = default;
};

/// A stop rule against the runs [0, num_runs), as it was stored.
struct StopCheckRow {
  std::string statistic;  ///< `std(gain)`.
  std::uint64_t num_runs = 0;
  StopCheck check;
};

/// A second result that is not the stored one.
struct Contradiction {
  RunIndex run;
  std::string worker;         ///< Name of the one that delivered it.
  std::string stored_digest;  ///< FNV-1a of the stored result, hexadecimal.
  std::string second_digest;
};

/// A warning of a run, and how many of them a file keeps.
struct RunWarning {
  RunIndex run;
  Warning warning;
};
inline constexpr std::size_t num_warnings_kept = 1'000'000;

/// What tells whether results are those that were stored, each 64 hexadecimal digits.
struct ResultDigests {
  std::string results;  ///< Of what was found of each run.
  std::string health;   ///< Of the health of their loops; empty if none of them has any.

  bool operator==(const ResultDigests&) const = default;
};

/// What the stored statistics were computed from.
struct Summary {
  std::uint64_t num_finished = 0;
  std::uint64_t num_counted = 0;   ///< Those of each status together: as many.
  std::uint64_t num_given_up = 0;  ///< Not among the finished ones.
  ResultDigests digests;

  bool operator==(const Summary&) const = default;
};

/// What one part gave to the whole when campaign databases were merged.
struct MergedPart {
  std::uint64_t num_new = 0;
  std::uint64_t num_again = 0;  ///< Runs that a part before it has as well, with the same result.

  bool operator==(const MergedPart&) const = default;
};

/// A line of the campaign's log, as it was stored.
struct StoredEvent {
  std::uint64_t id = 0;       ///< Ascending in time; from 1.
  std::string time_utc = {};  ///< As in `2024-02-29T12:00:10.123Z`.
  std::string kind = {};
  std::string text = {};

  bool operator==(const StoredEvent&) const = default;
};

/// Finished runs that ended without an estimate in one way.
struct EndCount {
  std::string status = {};   ///< `not finite`, `no draw`, `lost`.
  std::string cause = {};    ///< Of lost ones; else empty.
  std::string session = {};  ///< In which they were lost; else empty.
  std::uint64_t num_runs = 0;
};

/// A run that crashed too many workers.
struct GivenUpRecord {
  RunIndex run = {};
  std::string reason = {};  ///< Of the last crash.
  std::uint64_t num_attempts = 0;
  std::string given_up_utc = {};
};

/// Runs that one thread of a worker computed together and delivered within one second, or that came
/// back without a result.
struct RecentAttempt {
  std::uint64_t worker_key = 0;
  std::string worker = {};  ///< Its name.
  std::uint64_t num_runs = 1;
  RunIndex first = {};
  RunIndex last = {};
  wire::Attempt attempt = {};
  double compute_s = 0.0;    ///< Of all of them; 0 without a result.
  std::uint64_t unix_s = 0;  ///< When the results came, or the runs were lost.
  std::string reason = {};   ///< Of a loss.
};

/// The newest attempts of a campaign.
struct RecentAttempts {
  std::vector<RecentAttempt> computed = {};  ///< The newest first.
  std::vector<RecentAttempt> lost = {};      ///< The newest first.
  std::uint64_t num_runs_left_out = 0;       ///< Older delivered runs.
};

}  // namespace proofmass::coordinator
