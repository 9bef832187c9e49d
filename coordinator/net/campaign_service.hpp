#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

/// How a service is asked to end; set by signal handlers.
enum class StopRequest : std::uint8_t {
  none,
  drain,  ///< When the runs that workers hold are stored.
  now,    ///< With what has been delivered.
};

/// Settings of a service.
struct ServiceConfig {
  DispatchConfig dispatch;
  std::size_t commit_runs_max = 256;  ///< A commit waits for so many results ...
  Duration commit_after = std::chrono::milliseconds(50);  ///< ... or for so long.
};

/// Where a campaign stands.
struct CampaignProgress {
  std::uint64_t num_done = 0;  ///< Durably stored, earlier ones included.
  std::uint64_t num_runs = 0;
  std::uint64_t num_without_estimate = 0;  ///< Of those delivered to this service.
  std::size_t num_workers = 0;
  double rate_hz = 0.0;  ///< Runs stored per second since this service began.
};

/// Makes results durable; throws if it cannot.
using Commit = std::function<void(std::span<const Delivery>)>;
using Log = std::function<void(const Event&)>;

/// The coordinator of one campaign: serves workers at a socket, by one thread, until all runs are
/// stored.
class CampaignService {
 public:
  /// Binds the socket.
  ///
  /// @param campaign  Validated; shared with the dispatch.
  /// @param finished  Runs that are stored already.
  /// @param endpoint  An address that wire::check_endpoint() accepts; its port may be `*`.
  /// @throws InvalidArgument if the endpoint is not acceptable, Error if it cannot be bound.
  CampaignService(std::shared_ptr<const Campaign> campaign, std::span<const RunRange> finished,
                  const std::string& endpoint, Commit commit, Log log,
                  const ServiceConfig& config = {});
  ~CampaignService();
  CampaignService(const CampaignService&) = delete;
  CampaignService& operator=(const CampaignService&) = delete;

  /// The address to connect to, with the port that was chosen.
  [[nodiscard]] std::string endpoint() const;

  /// Serves until the campaign is finished or a stop is requested; then workers have been told to
  /// end and all that was delivered is stored.
  ///
  /// @param on_turn  Called many times a second; may call the other functions, may throw.
  /// @return True if the campaign is finished.
  [[nodiscard]] bool run(const std::atomic<StopRequest>& stop,
                         const std::function<void()>& on_turn);

  [[nodiscard]] CampaignProgress progress() const;

  /// Runs lent to the worker with this process on this host; empty if there is none.
  [[nodiscard]] RunSet runs_held_by(std::uint64_t process_id) const;

  /// That process is known to have ended: its runs are lent again at once.
  void process_ended(std::uint64_t process_id, const std::string& reason);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace proofmass::coordinator
