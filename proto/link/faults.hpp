#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::wire {

// Faults on purpose, for tests of a program by itself. In programs that are installed, nothing of
// this does anything (no_faults.cpp). Tests build programs with an option `--faults` that says what
// shall go wrong: they define the same functions anew, see tests/support/faults.

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

/// Marks a place. Any thread.
void kill_point(KillPoint point);

using LinkTime = std::chrono::steady_clock::time_point;

/// A message on its way.
struct Parcel {
  std::string routing;  ///< Whom it goes to or comes from.
  std::string bytes;
};

/// Stands between a service and its socket, one for each direction, and loses, delays or doubles
/// messages.
class LinkFaults {
 public:
  enum class Direction : std::uint8_t { sending = 1, receiving = 2 };

  virtual ~LinkFaults() = default;

  /// Hands a message over; it comes out of due() some time, once, twice or not at all.
  ///
  /// @param now  Never earlier than in the call before.
  virtual void pass(std::string routing, std::string bytes, LinkTime now) = 0;

  /// Takes all messages whose time has come, in order of that time.
  [[nodiscard]] virtual std::vector<Parcel> due(LinkTime now) = 0;
};

/// Null if messages shall pass as they are.
[[nodiscard]] std::unique_ptr<LinkFaults> link_faults(LinkFaults::Direction direction);

void add_fault_option(CLI::App& app);

}  // namespace proofmass::wire
