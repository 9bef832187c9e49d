#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/identifiers.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::wire {

/// Grows with every change that an older peer would misunderstand.
inline constexpr std::uint32_t protocol_version = 1;

inline constexpr std::uint32_t runs_per_lease_max = 4096;
inline constexpr std::size_t leases_held_max = 4096;
inline constexpr std::uint32_t slots_max = 1024;

/// Number of a worker's registration with a coordinator, from 1.
struct WorkerId {
  std::uint64_t value = 0;
  auto operator<=>(const WorkerId&) const = default;
};

/// Number of a lease, unique for a coordinator's lifetime, from 1.
struct LeaseId {
  std::uint64_t value = 0;
  auto operator<=>(const LeaseId&) const = default;
};

/// How often runs have been lent, this time included; from 1.
struct Attempt {
  std::uint32_t value = 1;
  auto operator<=>(const Attempt&) const = default;
};

/// Worker → coordinator: asks to be registered.
struct Hello {
  std::string worker_name;  ///< is_name() holds.
  std::string host;         ///< is_name() holds.
  std::uint64_t process_id = 0;
  std::uint32_t num_slots = 1;  ///< Runs that it simulates at a time, 1 to slots_max.
  std::string model_version;    ///< is_name() holds.
};

/// Coordinator → worker: registered, with no lease yet.
struct Welcome {
  WorkerId worker;
  double heartbeat_interval_s = 0.0;  ///< > 0.
  /// Without the `table` values, which come with each lease. Shared by the coordinator's state and
  /// all messages under way, because an environment table may have millions of numbers.
  std::shared_ptr<const Campaign> campaign;
};

/// The values are sent: never renumber.
enum class RejectReason : std::uint8_t {
  not_registered = 1,  ///< Say Hello (again); the only reason that is not final.
  incompatible = 2,    ///< Other protocol or model.
  malformed = 3,       ///< Something that the worker sent broke the rules.
  full = 4,            ///< The coordinator serves as many workers as it can.
};

/// Coordinator → worker: not registered, and why.
struct Reject {
  RejectReason reason = RejectReason::not_registered;
  std::string text;  ///< For people.
};

/// Worker → coordinator: the most unfinished runs that it wants to hold altogether. Absolute, so
/// that a lost or repeated one does no harm.
struct Credit {
  std::uint32_t num_runs_max = 0;  ///< At most runs_per_lease_max.
};

/// Coordinator → worker: runs that are lent to it.
struct RunLease {
  LeaseId lease;
  RunRange runs;  ///< 1 to runs_per_lease_max of them.
  Attempt attempt;
  std::vector<double> table_values;  ///< Shape [runs.count, table quantities].
};

/// A result and what it took.
struct ComputedRun {
  RunResult result;
  double compute_s = 0.0;  ///< ≥ 0.
};

/// Worker → coordinator: results of one lease, repeated until acknowledged.
struct ResultBatch {
  LeaseId lease;
  Attempt attempt;
  std::vector<ComputedRun> results;  ///< 1 to runs_per_lease_max.
};

/// Coordinator → worker: these runs are durably stored.
struct ResultAck {
  std::vector<RunIndex> runs;  ///< 1 to runs_per_lease_max.
};

/// Worker → coordinator: it lives, and this is what it holds.
struct Heartbeat {
  std::uint64_t num_orbits_done = 0;  ///< Since the process began.
  /// Leases of which a run is unfinished or not acknowledged; at most leases_held_max.
  std::vector<LeaseId> leases;
};

struct HeartbeatAck {};  ///< Coordinator → worker: the coordinator lives.
struct Bye {};    ///< Worker → coordinator: it leaves; what it holds may be lent to others.
struct Drain {};  ///< Coordinator → worker: deliver what you hold, then say Bye and end.
struct Stop {};   ///< Coordinator → worker: drop what you hold and end.

using Message = std::variant<Hello, Welcome, Reject, Credit, RunLease, ResultBatch, ResultAck,
                             Heartbeat, HeartbeatAck, Bye, Drain, Stop>;

}  // namespace proofmass::wire
