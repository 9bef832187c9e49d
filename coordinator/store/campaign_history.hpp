#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/store/records.hpp"
#include "core/runs.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator::detail {
class Database;
}  // namespace proofmass::coordinator::detail

namespace proofmass::coordinator {

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

/// Runs that one thread of a worker computed together and delivered within one second.
struct ComputedRuns {
  std::vector<RunIndex> runs = {};  ///< Ascending.
  wire::Attempt attempt = {};
  std::uint64_t worker_key = 0;
  double compute_s = 0.0;             ///< Of all of them.
  std::uint64_t received_unix_s = 0;  ///< When the results came.
};

/// Runs that came back without a result.
struct LostAttempt {
  RunRange runs = {};
  wire::Attempt attempt = {};
  std::uint64_t worker_key = 0;
  std::string reason = {};
  std::uint64_t lost_unix_s = 0;
};

/// A worker that delivered or lost runs.
struct WorkerRecord {
  std::uint64_t key = 0;
  std::string name = {};
  std::string host = {};
};

/// The newest attempts of a campaign.
struct RecentAttempts {
  std::vector<ComputedRuns> computed = {};  ///< The newest first.
  std::vector<LostAttempt> lost = {};       ///< The newest first.
  std::vector<WorkerRecord> workers = {};   ///< The workers of `computed` and `lost`, by key.
  std::uint64_t num_runs_left_out = 0;      ///< Older delivered runs.
};

/// Reads what happened to a campaign from its database, also while a coordinator writes to it. For
/// one thread. All functions throw StoreError if the file cannot be read.
class CampaignHistory {
 public:
  /// @throws StoreError as Store::open_read_only() does.
  explicit CampaignHistory(const std::filesystem::path& file);
  ~CampaignHistory();
  CampaignHistory(const CampaignHistory&) = delete;
  CampaignHistory& operator=(const CampaignHistory&) = delete;

  /// The newest `count_max` events after the one with this id, in order.
  [[nodiscard]] std::vector<StoredEvent> events_after(std::uint64_t id,
                                                      std::size_t count_max) const;
  /// By reason, the one with the most runs first.
  [[nodiscard]] std::vector<LossCount> losses() const;
  /// The ways in which finished runs ended without an estimate that converged, the most frequent
  /// first.
  [[nodiscard]] std::vector<EndCount> ends_without_estimate() const;
  /// The first `count_max` runs that were given up.
  [[nodiscard]] std::vector<GivenUpRecord> given_up(std::size_t count_max) const;
  /// @param num_runs_max    How many of the newest delivered runs are looked at.
  /// @param num_losses_max  How many of the newest losses are looked at.
  [[nodiscard]] RecentAttempts recent_attempts(std::size_t num_runs_max,
                                               std::size_t num_losses_max) const;

 private:
  std::unique_ptr<detail::Database> database_;
};

}  // namespace proofmass::coordinator
