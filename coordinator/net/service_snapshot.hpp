#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// What factories last said of themselves; in memory only. A factory that is silent for more than
/// three of its intervals is forgotten.
class FactoryReports {
 public:
  /// Replaces the report of the same name and owner.
  /// @param owner  Name of the key that reports; empty without keys.
  /// @throws Error if the limit of known factories is reached.
  void take(const proto::FactoryReport& report, const std::string& owner, TimePoint now);

  /// By name, at most wire::factories_max.
  [[nodiscard]] std::vector<proto::FactoryStatus> current(TimePoint now) const;

 private:
  struct Known {
    proto::FactoryReport report;
    TimePoint heard_at;
  };

  [[nodiscard]] static bool is_silent(const Known& known, TimePoint now);

  std::map<std::pair<std::string, std::string>, Known> known_;  ///< By name and owner.
};

/// What a worker does, as far as the coordinator knows. Each worker is in one of these states.
enum class WorkerActivity : std::uint8_t {
  computing,    ///< It holds runs.
  idle,         ///< It holds none.
  silent,       ///< It has said nothing for DispatchConfig::suspect_after: is lent nothing more.
  quarantined,  ///< Too many workers crashed on its host: is lent nothing more.
};

inline constexpr std::array worker_activities{WorkerActivity::computing, WorkerActivity::idle,
                                              WorkerActivity::silent, WorkerActivity::quarantined};

[[nodiscard]] std::string_view name_of(WorkerActivity activity);  ///< `computing`, `idle`, ...

struct RegisteredWorker {
  proto::WorkerStatus status = {};
  WorkerActivity activity = WorkerActivity::idle;
  double registered_s = 0.0;  ///< Since it registered with this coordinator.
};

/// Everything about a service at one instant. It refers to nothing of the service, so that another
/// thread may keep it.
struct ServiceSnapshot {
  TimePoint taken_at = {};         ///< By the clock of whoever keeps it; set by SnapshotBoard.
  proto::StatusReply status = {};  ///< Without the campaigns, which are below.
  std::vector<CampaignRecord> campaigns = {};  ///< All, in the order in which they came.
  std::vector<RegisteredWorker> workers = {};  ///< All, by number.
  /// Of each of worker_activities.
  std::array<std::uint64_t, worker_activities.size()> num_workers_by_activity{};
  std::uint64_t num_leases = 0;
  std::uint64_t num_sockets_reset = 0;    ///< How often a lack of memory closed the sockets.
  std::uint64_t num_messages_unsent = 0;  ///< To workers; dropped because they found no room.
};

[[nodiscard]] RegisteredWorker record_of(const State& state, WorkerId id, const Worker& worker,
                                         TimePoint now);

/// Copies the workers, of which 10,000 take some milliseconds, and counts them by activity.
void take_workers(const State& state, TimePoint now, ServiceSnapshot& snapshot);

}  // namespace proofmass::coordinator
