#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/wire/messages.hpp"

namespace proofmass::wire {

/// What a client does with a campaign. The values are sent: never renumber.
enum class ControlAction : std::uint8_t {
  pause = 1,
  resume = 2,
  cancel = 3,
  set_priority = 4,
  retry = 5,    ///< The runs that were given up are lent again.
  archive = 6,  ///< It is no longer served; its file moves to `archived`.
};

/// Whether a factory submits. The values are sent: never renumber.
enum class FactoryPhase : std::uint8_t {
  active = 1,
  waiting = 2,  ///< Tries again after a time.
  paused = 3,   ///< Submits nothing until it is started again.
};

/// How a factory that keeps workers in a batch system's queue stands. It repeats this with each of
/// its looks; the coordinator forgets it after three intervals without another one.
struct FactoryReport {
  std::string name;          ///< is_name() holds.
  std::string batch_system;  ///< is_name() holds.
  FactoryPhase phase = FactoryPhase::active;
  std::uint64_t num_wanted = 0;      ///< Workers that the open runs are worth, of any origin.
  std::uint64_t num_registered = 0;  ///< Of its own.
  std::uint64_t num_queued = 0;      ///< Its allocations without a registered worker.
  double wait_s = 0.0;               ///< Until the next attempt; 0 unless it waits.
  std::string reason = {};           ///< Why it is not active.
  std::uint64_t interval_s = 1;      ///< Between two reports; 1 to factory_interval_s_max.
};

/// Whether a campaign's runs are lent. The values are sent: never renumber.
enum class CampaignPhase : std::uint8_t {
  active = 1,
  paused = 2,
  finished = 3,   ///< Every run is stored or given up.
  cancelled = 4,  ///< Open runs are dropped; what is stored stands.
};

/// Where a campaign stands. Counts of runs, each exact.
struct CampaignStatus {
  std::string name;
  CampaignPhase phase = CampaignPhase::active;
  int priority = 0;
  std::uint64_t num_runs = 0;
  std::uint64_t num_done = 0;              ///< Durably stored.
  std::uint64_t num_without_estimate = 0;  ///< Of results stored since the coordinator started.
  std::uint64_t num_given_up = 0;          ///< Crashed too many workers.
  std::uint64_t num_lent = 0;
  std::uint64_t num_duplicates = 0;  ///< Results that were there already.
  std::uint64_t num_audited = 0;
  std::uint64_t num_mismatches = 0;        ///< Of the audited and duplicate ones; must be 0.
  double rate_hz = 0.0;                    ///< Runs stored per second, recently.
  std::optional<double> remaining_s = {};  ///< At that rate.
  std::string storage_failure = {};        ///< Why nothing can be stored; empty if all is well.
  std::string owner = {};  ///< Name of the key that submitted it; empty if not known.
};

/// A number of runs or results in CampaignStatus.
struct CampaignCounter {
  std::string_view name;  ///< Of the field of the message, and of the key in JSON.
  std::uint64_t CampaignStatus::*count;
  std::string_view metric;  ///< Name in `/metrics`: a counter if it ends in `_total`.
  std::string_view help;    ///< What `/metrics` says of it.
};

/// All of them: messages, JSON and metrics have what stands here. A new one needs its field in
/// client.proto and above, a row here, its count in CampaignState, and
/// CampaignService::record_of().
inline constexpr std::array campaign_counters{
    CampaignCounter{"num_runs", &CampaignStatus::num_runs, "proofmass_runs_wanted",
                    "Runs that the campaign is to have."},
    CampaignCounter{"num_done", &CampaignStatus::num_done, "proofmass_runs_finished_total",
                    "Runs whose results are on disk."},
    CampaignCounter{"num_without_estimate", &CampaignStatus::num_without_estimate,
                    "proofmass_runs_without_estimate_total",
                    "Runs that ended without an estimate since the coordinator started."},
    CampaignCounter{"num_given_up", &CampaignStatus::num_given_up, "proofmass_runs_given_up",
                    "Runs that crashed too many workers."},
    CampaignCounter{"num_lent", &CampaignStatus::num_lent, "proofmass_runs_lent",
                    "Runs that workers hold."},
    CampaignCounter{"num_duplicates", &CampaignStatus::num_duplicates,
                    "proofmass_results_duplicate_total", "Results that were there already."},
    CampaignCounter{"num_audited", &CampaignStatus::num_audited, "proofmass_results_compared_total",
                    "Results that were compared with a second computation."},
    CampaignCounter{"num_mismatches", &CampaignStatus::num_mismatches,
                    "proofmass_results_different_total",
                    "Compared results that differ; must be 0."},
};

/// A file that should be served and cannot be for now. It is tried again every few seconds.
struct UnservedFile {
  std::string file;
  std::string reason;
};

/// A factory as the coordinator knows it.
struct FactoryStatus {
  FactoryReport report;    ///< The last one.
  std::string owner = {};  ///< Name of the key that reported; empty if there are no keys.
  double silent_s = 0.0;   ///< Since then.
};

struct StatusReply {
  std::string version;  ///< Of the coordinator's program.
  std::string model_version;
  double uptime_s = 0.0;
  std::uint64_t num_workers = 0;
  std::uint64_t num_slots = 0;
  /// In the order in which they were submitted, from StatusRequest::first_campaign on.
  std::vector<CampaignStatus> campaigns;
  std::uint64_t num_campaigns = 0;  ///< Of all, in this reply or not.
  std::vector<UnservedFile> unserved_files = {};
  std::uint64_t num_unserved_files = 0;  ///< Of all, in this reply or not.
  std::vector<std::string> quarantined_hosts = {};
  std::uint64_t num_quarantined_hosts = 0;    ///< Of all, in this reply or not.
  std::vector<FactoryStatus> factories = {};  ///< All.
};

/// A registered worker.
struct WorkerStatus {
  WorkerId id;
  std::string name;
  std::string host;
  std::uint64_t process_id = 0;
  std::uint64_t num_slots = 0;
  std::uint64_t num_lent = 0;
  std::uint64_t num_results = 0;
  double silent_s = 0.0;  ///< Since its last message.
  bool is_quarantined = false;
};

struct WorkersReply {
  std::vector<WorkerStatus> workers;  ///< Ascending, after WorkersRequest::after_worker_id.
  std::uint64_t num_workers = 0;      ///< Of all, in this reply or not.
};

}  // namespace proofmass::wire
