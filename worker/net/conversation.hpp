#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/wire/messages.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::worker {

/// A monotonic time, handed in by the caller.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// How a worker's service ended.
struct Ending {
  enum class Kind : std::uint8_t {
    done,    ///< It was told to end, or asked to.
    failed,  ///< It cannot go on.
  };
  Kind kind = Kind::done;
  std::string reason;  ///< For people.
};

/// Periods of a worker's conversation.
struct ConversationConfig {
  Duration hello_interval = std::chrono::seconds(1);
  Duration resend_after = std::chrono::seconds(5);  ///< Results without an acknowledgement.
  Duration unreachable_after = std::chrono::seconds(60);
};

/// A worker's side of the protocol, without socket, clock or thread: registers, hands leases to the
/// execution, keeps results until they are acknowledged, shows that it lives.
class Conversation {
 public:
  using Send = std::function<void(const wire::Message&)>;

  /// @param execution  Must outlive this object.
  /// @param send       May lose messages.
  Conversation(wire::Hello hello, Execution& execution, Send send, TimePoint now,
               const ConversationConfig& config = {});

  void on_message(const wire::Message& message, TimePoint now);
  /// Messages sent before had nowhere to go: repeats the Hello at once.
  void on_connected(TimePoint now);
  /// The execution has something new to take.
  void on_progress(TimePoint now);
  /// To be called some times a second.
  void on_tick(TimePoint now);
  /// Gives everything back and leaves.
  void on_stop_request();

  /// Present once the conversation is over.
  [[nodiscard]] const std::optional<Ending>& ending() const { return ending_; }
  [[nodiscard]] std::size_t num_unacknowledged() const { return unacknowledged_.size(); }

 private:
  struct SentRun {
    FinishedRun finished;
    TimePoint sent_at;
  };

  void handle(const wire::Welcome& welcome, TimePoint now);
  void handle(const wire::Reject& reject, TimePoint now);
  void handle(const wire::RunLease& lease, TimePoint now);
  void handle(const wire::ResultAck& ack, TimePoint now);
  void handle(const wire::Drain& drain, TimePoint now);
  void handle(const wire::Stop& stop, TimePoint now);
  template <typename Other>
  void handle(const Other&, TimePoint) {}  // What only a worker sends means nothing here.

  void say_hello(TimePoint now);
  void send_credit();
  void send_heartbeat(TimePoint now);
  void send_results(std::vector<SentRun*> runs, TimePoint now);
  void resend_results(TimePoint now, Duration older_than);
  void leave_if_drained();
  void end(Ending::Kind kind, std::string reason);

  wire::Hello hello_;
  Execution& execution_;
  Send send_;
  ConversationConfig config_;
  bool is_registered_ = false;
  bool is_draining_ = false;
  std::string campaign_bytes_;   ///< Of the campaign that the execution has; empty if none.
  std::size_t table_width_ = 0;  ///< Table values of one run.
  Duration heartbeat_interval_{};
  TimePoint heard_at_;
  TimePoint hello_at_;
  TimePoint heartbeat_at_;
  std::map<RunIndex, SentRun> unacknowledged_;
  std::optional<Ending> ending_;
};

}  // namespace proofmass::worker
