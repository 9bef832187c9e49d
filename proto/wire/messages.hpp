#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"

namespace proofmass::wire {

/// Grows with every change that an older peer would misunderstand.
inline constexpr std::uint32_t protocol_version = 7;

inline constexpr std::uint32_t runs_per_lease_max = 4096;  ///< Also of a batch of results.
inline constexpr std::size_t ranges_per_message_max = 4096;
inline constexpr std::uint32_t slots_max = 4096;
inline constexpr std::size_t definition_part_size_max = std::size_t{256} << 10;  ///< Bytes.

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

/// What comes with every message.
struct Header {
  SessionId session;  ///< Of the worker that sends or receives the message.
  Epoch epoch;        ///< Of the coordinator as the sender knows it; none in a Hello.
  /// Number of the message among those of its sender to this receiver, ascending. Tells which of
  /// two statements that replace each other is the later one.
  std::uint64_t sequence = 0;

  auto operator<=>(const Header&) const = default;
};

/// Runs of one campaign that a worker holds or gives back, under one attempt.
struct HeldRuns {
  CampaignId campaign;
  Attempt attempt;
  std::vector<RunRange> ranges;  ///< Not empty; each of 1 run or more.

  auto operator<=>(const HeldRuns&) const = default;
};

/// Why runs came back without a result. The values are stored and sent: never renumber.
enum class LossReason : std::uint8_t {
  silent = 1,         ///< The worker was not heard for too long.
  crashed = 2,        ///< Its process was ended by a signal. Counts against the runs it computed.
  out_of_memory = 3,  ///< Its process was ended for its use of memory. Counts as well.
  hung = 4,           ///< No step was finished for too long. Counts as well.
  drained = 5,        ///< The worker was told to leave.
  walltime = 6,       ///< The worker's time is up.
  preempted = 7,      ///< The worker was asked to end by a signal.
  retracted = 8,      ///< The coordinator wanted them back.
  never_arrived = 9,  ///< The worker does not hold them: a message was lost.
  protocol = 10,      ///< The worker broke the rules, or lost its permission.
  failed = 11,        ///< The worker says that it cannot compute.
};

/// How a worker's process before this one ended, told by its successor.
struct FormerSession {
  SessionId session;
  LossReason reason = LossReason::crashed;  ///< crashed or out_of_memory.
  std::uint32_t signal = 0;
};

/// Worker → coordinator: asks to be registered.
struct Hello {
  std::string worker_name;  ///< is_name() holds.
  std::string host;         ///< is_name() holds.
  std::uint64_t process_id = 0;
  std::uint32_t num_slots = 1;  ///< Runs that it simulates at a time, 1 to slots_max.
  std::string model_version;    ///< is_name() holds.
  std::string build;            ///< is_name() holds; program version, for people.
  /// Digest of core's reference simulation, computed by this worker on this processor.
  std::uint64_t reference_digest = 0;
  std::optional<FormerSession> former;
};

/// Coordinator → worker: registered; the header's epoch is the coordinator's.
struct Welcome {
  WorkerId worker;
  double heartbeat_interval_s = 0.0;  ///< > 0.
};

/// The values are sent: never renumber.
enum class RejectReason : std::uint8_t {
  not_registered = 1,  ///< Say Hello (again).
  incompatible = 2,    ///< Other protocol, model or reference digest. Final.
  malformed = 3,       ///< Something sent broke the rules: nothing more is heard on the connection.
  full = 4,            ///< The coordinator serves as many workers as it can; ask later.
  quarantined = 5,     ///< Too much crashed on this host; ask later.
  revoked = 6,         ///< The worker's key is not on the list any more; ask for minutes.
};

/// Coordinator → worker: not registered, and why.
struct Reject {
  RejectReason reason = RejectReason::not_registered;
  std::string text;  ///< For people.
};

/// Worker → coordinator: asks for a part of the definition of a campaign of which it was lent runs.
struct CampaignRequest {
  CampaignId campaign;
  std::uint64_t offset = 0;  ///< Bytes that it has; below definition_size_max.
};

/// Coordinator → worker: the answer, a part of what encode_definition() returns. It starts at the
/// offset that was asked for, or at 0 if that is beyond the end.
struct DefinitionPart {
  CampaignId campaign;
  std::uint64_t offset = 0;
  std::uint64_t total_size = 0;  ///< Bytes of the whole; 1 to definition_size_max.
  std::uint64_t checksum = 0;    ///< fnv1a() of the whole.
  std::string content;           ///< 1 to definition_part_size_max bytes, within the whole.
};

/// Coordinator → worker: the campaign is finished or cancelled. Drop its runs below `num_runs`, and
/// their results. Runs from there on may belong to an extension that this coordinator does not
/// know.
struct Forget {
  CampaignId campaign;
  std::uint64_t num_runs = num_runs_max;  ///< 1 to num_runs_max.
};

/// Coordinator → worker: results of these runs cannot be taken now, because the campaign is not
/// served or has fewer runs. Keep the results and offer them again later; drop what waits.
struct NotServed {
  CampaignId campaign;
  std::vector<RunRange> ranges;  ///< At most ranges_per_message_max; none: the whole campaign.
};

/// Coordinator → worker: runs that are lent to it.
struct RunLease {
  CampaignId campaign;
  RunRange runs;  ///< 1 to runs_per_lease_max of them.
  Attempt attempt;
  /// The runs may have crashed a worker: compute each in a batch of its own.
  bool is_alone = false;
  /// Runs of a batch that begins with one of these, at most; 0: as many as the worker can compute
  /// together. The last runs of a campaign end sooner in more and smaller batches.
  std::uint32_t batch_runs_max = 0;
  std::vector<double> table_values;  ///< Shape [runs.count, table quantities].
};

/// Coordinator → worker: give back those of these runs that are not being computed yet.
struct Retract {
  CampaignId campaign;
  std::vector<RunRange> ranges;  ///< 1 to ranges_per_message_max.
};

/// Worker → coordinator: it holds these runs no more and will send no result.
struct GiveBack {
  LossReason reason = LossReason::retracted;
  std::vector<HeldRuns> runs;  ///< At most ranges_per_message_max ranges altogether; not empty.
};

/// A result and what it took.
struct ComputedRun {
  RunResult result;
  double compute_s = 0.0;  ///< Time of a thread: its share of the batch it was in; 0 to 1e9.
  double elapsed_s = 0.0;  ///< From its beginning to its end: the time of that batch; 0 to 1e9.
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

/// Worker → coordinator: results, repeated until acknowledged.
struct ResultBatch {
  CampaignId campaign;
  Attempt attempt;
  std::vector<ComputedRun> results;  ///< 1 to runs_per_lease_max.
};

/// Coordinator → worker: these results are durably stored and may be forgotten.
struct ResultAck {
  CampaignId campaign;
  std::vector<RunIndex> runs;  ///< 1 to runs_per_lease_max.
};

/// Runs that one thread of a worker computes together.
struct ComputedBatch {
  CampaignId campaign;
  std::vector<RunRange> ranges;  ///< Not empty.
  std::uint32_t num_steps_done = 0;

  auto operator<=>(const ComputedBatch&) const = default;
};

/// Worker → coordinator: it lives, and this is what it holds and wants. A later one replaces all
/// earlier ones.
struct Heartbeat {
  /// Most unfinished runs that it wants to hold altogether, at most runs_per_lease_max.
  std::uint32_t num_runs_max = 0;
  std::uint64_t num_steps_done = 0;  ///< Since the process began.
  /// Runs that wait, are being computed, or whose result is not acknowledged; at most
  /// ranges_per_message_max ranges.
  std::vector<HeldRuns> held;
  std::vector<ComputedBatch> computing;  ///< At most slots_max.
  /// Finished runs whose results the coordinator did not take (NotServed); together with `held` at
  /// most ranges_per_message_max ranges.
  std::vector<HeldRuns> set_aside = {};
};

struct HeartbeatAck {};  ///< Coordinator → worker: the coordinator lives.

/// Worker → coordinator: it leaves; what it holds may be lent to others.
struct Bye {
  LossReason reason = LossReason::preempted;  ///< drained, walltime, preempted or failed.
};

struct Drain {};  ///< Coordinator → worker: deliver what you hold, then say Bye and end.
struct Stop {};   ///< Coordinator → worker: drop what you hold and end.

// Both sides handle each of the types that can reach them by an overload of its own: a type that is
// new in one of these lists does not compile before it is encoded and handled.

/// What a worker says to a coordinator.
using WorkerMessage = std::variant<Hello, CampaignRequest, GiveBack, ResultBatch, Heartbeat, Bye>;
/// What a coordinator says to a worker.
using CoordinatorMessage = std::variant<Welcome, Reject, DefinitionPart, Forget, NotServed,
                                        RunLease, Retract, ResultAck, HeartbeatAck, Drain, Stop>;

namespace detail {

template <typename First, typename Second>
struct Joined;
template <typename... First, typename... Second>
struct Joined<std::variant<First...>, std::variant<Second...>> {
  using type = std::variant<First..., Second...>;
};

template <typename Content, typename Messages>
inline constexpr bool is_among = false;
template <typename Content, typename... Contents>
inline constexpr bool is_among<Content, std::variant<Contents...>> =
    (std::is_same_v<Content, Contents> || ...);

}  // namespace detail

using Message = detail::Joined<WorkerMessage, CoordinatorMessage>::type;

/// Calls the handler with what the message holds if that is one of `Messages`, which is
/// WorkerMessage or CoordinatorMessage. The handler must take all of these, and gets the message
/// itself if that is a temporary one.
/// @return False if it is none of them.
template <typename Messages, typename AnyMessage, typename Handler>
bool visit_if(AnyMessage&& message, const Handler& handle) {
  return std::visit(
      [&]<typename Content>(Content&& content) {
        constexpr bool is_wanted = detail::is_among<std::remove_cvref_t<Content>, Messages>;
        if constexpr (is_wanted) handle(std::forward<Content>(content));
        return is_wanted;
      },
      std::forward<AnyMessage>(message));
}

/// A message as it travels.
struct Packet {
  Header header;
  Message message;
};

}  // namespace proofmass::wire
