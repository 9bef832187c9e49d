#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>

#include "core/campaign/definition.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"

// Values that messages between coordinator and workers carry, and the limits of messages. The
// messages themselves are the classes of proto/proofmass.proto: codec.hpp turns their parts
// into these values.

namespace proofmass::wire {

/// Grows with every change that an older peer would misunderstand.
inline constexpr std::uint32_t protocol_version = 8;

// Limits. The comments of proofmass.proto name them.

inline constexpr std::uint32_t runs_per_lease_max = 4096;  ///< Of a lease or a batch of results.
inline constexpr std::size_t ranges_per_message_max = 4096;
inline constexpr std::uint32_t slots_max = 65'536;             ///< Of a worker with cards.
inline constexpr std::uint32_t runs_held_max = 2 * slots_max;  ///< By a worker, not finished.
inline constexpr std::size_t cards_text_size_max = 256;        ///< Bytes.
inline constexpr std::size_t reject_text_size_max = 4096;      ///< Bytes.
inline constexpr std::size_t definition_part_size_max = std::size_t{256} << 10;  ///< Bytes.
/// Size limits of an encoded definition and of an encoded message, bytes. A definition travels in
/// parts.
inline constexpr std::size_t definition_size_max = std::size_t{64} << 20;
inline constexpr std::size_t message_size_max = std::size_t{4} << 20;
/// What a coordinator's socket takes at once, bytes. A peer that has shown no key yet may fill a
/// buffer of this size. Beyond it a connection is dropped, and made again in vain: ResultBatches
/// are smaller.
inline constexpr std::size_t router_message_size_max = std::size_t{1} << 20;
inline constexpr std::uint64_t definition_tables_max = 64;
inline constexpr std::uint64_t columns_of_a_table_max = 64;
inline constexpr std::uint64_t table_columns_max = 1024;
inline constexpr int other_models_max = 64;  ///< Of a worker, beside the built-in one.
inline constexpr double heartbeat_interval_s_max = 3600.0;
/// Of a run, some 30 years: the times of any number of runs can be added up.
inline constexpr double run_time_s_max = 1e9;
inline constexpr std::uint32_t signal_max = 64;

/// Number of a worker's registration with a coordinator, from 1.
struct WorkerId {
  std::uint64_t value = 0;
  auto operator<=>(const WorkerId&) const = default;
};

/// A worker process, by a random number that it chooses when it starts; not 0. It stays the same
/// through all connections and registrations of that process.
struct SessionId {
  std::uint64_t value = 0;
  auto operator<=>(const SessionId&) const = default;
};

/// A coordinator process, by a random number that it chooses when it starts; 0: none known.
struct Epoch {
  std::uint64_t value = 0;
  auto operator<=>(const Epoch&) const = default;
};

/// A campaign database, by a random number from when it was made; not 0.
struct CampaignId {
  std::uint64_t value = 0;
  auto operator<=>(const CampaignId&) const = default;
};

/// How often runs have been lent, this time included; from 1.
struct Attempt {
  std::uint32_t value = 1;
  auto operator<=>(const Attempt&) const = default;
};

/// Why runs came back without a result. The values are stored and sent: never renumber.
enum class LossReason : std::uint8_t {
  silent = 1,         ///< The worker was not heard for too long.
  crashed = 2,        ///< Its process was ended by a signal. Counts against the runs it computed.
  out_of_memory = 3,  ///< It was ended for its use of memory. Counts against the runs it computed.
  hung = 4,           ///< No step was finished for too long. Counts against the runs it computed.
  drained = 5,        ///< The worker was told to leave.
  walltime = 6,       ///< The worker's time is up.
  preempted = 7,      ///< The worker was asked to end by a signal.
  retracted = 8,      ///< The coordinator wanted them back.
  never_arrived = 9,  ///< The worker does not hold them: a message was lost.
  protocol = 10,      ///< The worker broke the rules, or lost its permission.
  failed = 11,        ///< The worker says that it cannot compute.
};

/// A result and what it took.
struct ComputedRun {
  RunResult result;
  double compute_s = 0.0;   ///< Time of a thread: its share of the batch it was in; 0 to 1e9.
  double elapsed_s = 0.0;   ///< From its beginning to its end: the time of that batch; 0 to 1e9.
  bool is_by_card = false;  ///< Not by a processor.
};

/// A result, and the lease under which it was computed. A RunResult is what a run yields, a
/// ComputedRun adds the time that it took, and this adds the campaign and the attempt: what a
/// worker keeps and the dispatch hands to the store. There it becomes a coordinator::Delivery, with
/// the session of the worker, which outlives the worker's number.
struct LeasedResult {
  CampaignId campaign;
  Attempt attempt;
  ComputedRun computed;
};

}  // namespace proofmass::wire
