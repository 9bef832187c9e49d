#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace proofmass::wire {

/// Places where a process can be made to die as by `kill -9`.
enum class KillPoint : std::uint8_t {
  // Coordinator.
  after_receive,      ///< A batch of results is received, and not yet queued for the store.
  before_commit,      ///< The rows are inserted, the transaction is open.
  after_commit,       ///< They are durable, and nobody knows.
  after_acknowledge,  ///< The acknowledgement is handed to the socket.
  after_lend,         ///< A lease is handed to the socket.
  after_open,         ///< A campaign database is open and locked.
  while_migrating,    ///< The tables of a campaign database are made or changed, not committed.
  // Worker.
  after_lease,    ///< A lease is received, and nothing is computed.
  before_result,  ///< Results are computed, and not yet sent.
  after_result,   ///< They are handed to the socket.
  before_bye,     ///< The worker leaves and has not said so.
};

inline constexpr int num_kill_points = 11;

[[nodiscard]] std::string_view to_text(KillPoint point);  ///< `after_commit`.
[[nodiscard]] std::optional<KillPoint> kill_point_from(std::string_view name);

/// Makes the process die when it passes a place for the n-th time.
/// To be called before the process has other threads.
///
/// @param passage  n, from 1.
void arm_kill_point(KillPoint point, std::uint64_t passage);

/// Marks a place. Costs a comparison if it is not armed. Any thread.
void kill_point(KillPoint point);

}  // namespace proofmass::wire
