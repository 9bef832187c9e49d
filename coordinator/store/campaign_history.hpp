#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/store/records.hpp"
#include "core/runs.hpp"
#include "proto/wire/messages.hpp"

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

}  // namespace proofmass::coordinator
