#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "proto/link/keys.hpp"
#include "proto/wire/messages.hpp"
#include "tests/benchmarks/null_execution.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass::test {

inline std::chrono::steady_clock::time_point time_now() { return std::chrono::steady_clock::now(); }

inline double seconds(worker::Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// What the workers of a swarm have seen since somebody last looked.
struct SwarmCount {
  std::uint64_t num_results = 0;            ///< Runs, repetitions included.
  std::uint64_t num_unsent = 0;             ///< Messages for which there was no room.
  std::vector<double> heartbeat_answers_s;  ///< From each heartbeat to its answer.
  /// From a result to its acknowledgement; of one in sixteen.
  std::vector<double> acknowledgements_s;
};

/// Settings of each worker of a swarm.
struct SwarmWorkerConfig {
  std::string endpoint;
  wire::ClientSecurity security;
  std::uint32_t num_slots = 1;
  std::uint32_t runs_held_max = wire::runs_per_lease_max;  ///< It wants no more at a time.
  double elapsed_s = 0.0;     ///< What it says that a run takes that takes no time.
  double batch_time_s = 0.0;  ///< Time of 16 runs, one thread for each 16 slots; 0: no time.
};

/// A worker whose runs compute nothing and that shares its process and thread with many: the
/// product's side of the protocol on a socket of its own.
class SwarmWorker {
 public:
  using TimePoint = worker::TimePoint;

  /// @param count  Outlives the worker.
  SwarmWorker(zmq::context_t& context, const SwarmWorkerConfig& config, wire::SessionId session,
              proto::Hello hello, SwarmCount& count, TimePoint now);
  SwarmWorker(const SwarmWorker&) = delete;
  SwarmWorker& operator=(const SwarmWorker&) = delete;

  /// Readable when serve() is to be called.
  [[nodiscard]] int descriptor();
  /// Handles all that has arrived.
  void serve(TimePoint now);
  /// To be called some times a second.
  void on_tick(TimePoint now);
  /// True if runs are to be finished by then: on_due() is to be called.
  [[nodiscard]] bool is_due(TimePoint now) const {
    return execution_.due_at() && *execution_.due_at() <= now;
  }
  void on_due(TimePoint now);

  [[nodiscard]] bool is_registered() const { return conversation_.is_registered(); }
  [[nodiscard]] bool has_ended() const { return conversation_.ending().has_value(); }
  /// How long the oldest heartbeat without an answer has been under way.
  [[nodiscard]] std::optional<worker::Duration> unanswered_for(TimePoint now) const;

 private:
  using RunKey = std::pair<wire::CampaignId, RunIndex>;

  void note_connection(TimePoint now);
  void send(proto::Envelope message);
  void receive(std::string_view bytes, TimePoint now);
  void note_sent(const proto::ResultBatch& batch, TimePoint now);
  void note_acknowledged(const proto::ResultAck& ack, TimePoint now);

  std::uint32_t runs_held_max_;
  SwarmCount& count_;
  NullExecution execution_;
  zmq::socket_t socket_;
  bool is_connected_ = false;
  std::vector<TimePoint> heartbeats_;  ///< Without an answer, the oldest first.
  std::map<RunKey, TimePoint> timed_;  ///< Results of which the acknowledgement is timed.
  worker::Conversation conversation_;  ///< Speaks while it is made: the last one.
};

}  // namespace proofmass::test
