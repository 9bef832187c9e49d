#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "proto/proofmass.pb.h"
#include "proto/text/event.hpp"
#include "proto/wire/definition_codec.hpp"
#include "proto/wire/messages.hpp"
#include "worker/execution/execution.hpp"
#include "worker/net/held_runs.hpp"

namespace proofmass::worker {

/// How a worker's service ended.
struct Ending {
  enum class Kind : std::uint8_t {
    done,    ///< It was told to end, asked to, or its time was up.
    failed,  ///< It cannot go on.
  };
  Kind kind = Kind::done;
  std::string reason;  ///< For people.
};

/// Times of a worker's conversation.
struct ConversationConfig {
  /// Between a Hello and the next; doubles from the first to the second, plus up to a quarter, by
  /// which a thousand workers of a coordinator that restarts come one after the other.
  Duration hello_delay = std::chrono::milliseconds(250);
  Duration hello_delay_max = std::chrono::seconds(32);
  /// Between a refusal that is not final and the next Hello; doubles and varies as hello_delay
  /// does. Refusals that are so much apart begin anew. A worker whose key is revoked for as long,
  /// so that it has asked four times at least, ends.
  Duration refusal_delay = std::chrono::seconds(15);
  Duration refusal_delay_max = std::chrono::seconds(60);
  Duration refusal_memory = std::chrono::minutes(5);
  Duration request_interval = std::chrono::seconds(1);  ///< Of a definition that does not come ...
  Duration request_again_after = std::chrono::seconds(60);  ///< ... or that makes no sense.
  /// Until a result without an acknowledgement is sent again; doubles from the first to the second.
  Duration resend_after = std::chrono::seconds(5);
  Duration resend_after_max = std::chrono::seconds(60);
  /// From a heartbeat to the next if other runs are being computed by then; otherwise the
  /// coordinator says how long.
  Duration news_interval = std::chrono::seconds(1);
  Duration give_up_after = std::chrono::hours(1);   ///< Of a coordinator that says nothing.
  Duration drain_time = std::chrono::seconds(100);  ///< To finish batches when asked to end.
  /// Kept free at the end of the drain or walltime, for results to be sent and acknowledged.
  Duration delivery_time = std::chrono::seconds(5);
  std::optional<TimePoint> walltime_end = {};  ///< When the process must have ended.
  /// A worker that has neither a run nor a result for so long leaves. Nothing: it stays.
  std::optional<Duration> idle_timeout = {};
  /// Results that are not acknowledged and runs at hand, altogether: a coordinator that cannot take
  /// results must not fill this worker's memory.
  std::size_t num_kept_max = 65'536;
};

/// A worker's side of the protocol, without socket, clock, thread or random device: registers,
/// hands leases to the execution, keeps results until they are acknowledged, says what it holds.
///
/// A coordinator that does not know the worker (any more) costs nothing: the runs at hand go on,
/// and after the next Welcome a heartbeat names them all.
class Conversation {
 public:
  using Send = std::function<void(proto::Envelope)>;

  /// @param session    Random; jitter follows from it, too.
  /// @param execution  Must outlive this object.
  /// @param send       May lose messages.
  Conversation(wire::SessionId session, proto::Hello hello, Execution& execution, Send send,
               TimePoint now, const ConversationConfig& config = {});

  /// Takes over results of a process before this one, to be delivered first.
  void restore(std::vector<wire::LeasedResult> results);

  /// @param message  decode() has returned it.
  void on_message(const proto::Envelope& message, TimePoint now);
  /// Messages sent before had nowhere to go.
  void on_connected(TimePoint now);
  /// True, once, if nothing more is heard on the present connection: another one is to be made.
  [[nodiscard]] bool take_reconnection() { return std::exchange(wants_connection_, false); }
  /// What has happened since the last call.
  [[nodiscard]] std::vector<wire::Event> take_events() { return std::exchange(events_, {}); }
  /// The coordinator does not let this worker in. It may some day; until then nothing else changes.
  void on_refused(const std::string& reason);
  /// The execution has something new to take.
  void on_progress(TimePoint now);
  /// To be called some times a second.
  void on_tick(TimePoint now);
  /// The process was stopped for so long: nothing that was said meanwhile has been heard.
  void on_slept(Duration duration) {
    heard_at_ += duration;
    busy_at_ += duration;
  }
  /// Gives back what has not begun, finishes what can be finished in time, delivers, leaves.
  void on_drain_request(TimePoint now);
  /// Leaves at once. The caller keeps the results, or they will be computed again.
  void on_abandon_request();

  /// Present once the conversation is over.
  [[nodiscard]] const std::optional<Ending>& ending() const { return ending_; }
  /// Since it was last heard of the coordinator, or since the conversation began.
  [[nodiscard]] Duration silence(TimePoint now) const { return now - heard_at_; }
  [[nodiscard]] bool is_registered() const { return is_registered_; }
  [[nodiscard]] bool is_leaving() const { return leaving_.has_value(); }
  [[nodiscard]] const UnacknowledgedResults& unacknowledged() const { return unacknowledged_; }
  /// Runs that wait or are being computed.
  [[nodiscard]] std::size_t num_unfinished() const { return unfinished_.size(); }

 private:
  struct WantedDefinition {
    wire::IncomingDefinition incoming;
    TimePoint request_due_at;  ///< When to ask (again) for the part that is missing.
  };

  /// The worker takes no more runs and ends when it holds none.
  struct Leaving {
    wire::LossReason reason = wire::LossReason::drained;
    std::optional<TimePoint> deadline;  ///< Nothing: as long as it takes.
  };

  void on_welcome(const proto::Envelope& message, TimePoint now);
  void on_reject(const proto::Envelope& message, TimePoint now);
  void on_definition_part(const proto::DefinitionPart& part, TimePoint now);
  void on_forget(const proto::Forget& forget);
  void on_not_served(const proto::NotServed& not_served);
  void on_lease(const proto::RunLease& lease, TimePoint now);

  void send(proto::Envelope message);
  void say_hello(TimePoint now);
  [[nodiscard]] Duration with_jitter(Duration delay) const;  ///< Up to a quarter more.
  void register_again(TimePoint now);
  void come_again(const proto::Reject& reject, TimePoint now);
  void request(wire::CampaignId campaign, TimePoint now);
  void request_definitions(TimePoint now);
  void define(wire::CampaignId campaign, TimePoint now);
  [[nodiscard]] bool agrees_on_table(wire::CampaignId campaign, std::size_t width);
  [[nodiscard]] std::vector<RunRange> new_runs(const proto::RunLease& lease);
  void send_heartbeat(TimePoint now);
  [[nodiscard]] bool computes_other_batches() const;
  [[nodiscard]] std::uint32_t credit() const;
  void set_aside(wire::CampaignId campaign, std::span<const RunRange> ranges);
  [[nodiscard]] std::vector<RunKey> keep_finished(TimePoint now);
  void send_results(std::vector<proto::ResultBatch> batches);
  void send_all_results(TimePoint now);
  void watch_time(TimePoint now);
  void watch_idleness(TimePoint now);
  [[nodiscard]] Duration time_to_leave() const;       ///< Before the walltime is over.
  [[nodiscard]] TimePoint walltime_deadline() const;  ///< @pre There is a walltime.
  void leave_by(TimePoint deadline, wire::LossReason reason, TimePoint now);
  void begin_to_leave(const Leaving& leaving, TimePoint now);
  void give_back_waiting();
  void give_back_late_batches(TimePoint now);
  void give_back(wire::LossReason reason, wire::CampaignId campaign,
                 std::span<const RunIndex> runs);
  void leave_if_done();
  void leave(const std::string& reason);
  void leave_unneeded(const std::string& reason);
  [[nodiscard]] std::string why_not_registered() const;
  void say_bye(wire::LossReason reason);
  void end(Ending::Kind kind, std::string reason);
  void note(wire::Event event);

  wire::SessionId session_;
  proto::Hello hello_;
  Execution& execution_;
  Send send_;
  ConversationConfig config_;

  wire::Epoch epoch_;  ///< Of the coordinator that sent the newest Welcome.
  std::uint64_t num_sent_ = 0;
  bool is_registered_ = false;
  Duration heartbeat_interval_{};
  TimePoint heard_at_;
  TimePoint busy_at_;  ///< When it last had a run or a result.
  TimePoint hello_due_at_;
  Duration hello_delay_{};
  std::uint64_t welcome_sequence_ = 0;  ///< Of the newest Welcome.
  bool is_refused_ = false;             ///< Since the last Hello.
  Duration refusal_delay_{};
  TimePoint refused_at_;
  std::set<proto::RejectReason> noted_refusals_;                 ///< Since the last Welcome.
  std::optional<std::pair<TimePoint, std::string>> revocation_;  ///< The first one since then.
  bool is_closed_out_ = false;  ///< The next Hello needs another connection.
  bool wants_connection_ = false;
  TimePoint heartbeat_at_;
  std::vector<std::uint64_t> reported_batches_;  ///< By the heartbeat sent last.
  std::string refusal_;  ///< Why there is no connection or registration; empty if not known.

  /// Table values of one run, as the first lease or the definition of a campaign has them.
  std::map<wire::CampaignId, std::size_t> table_widths_;
  std::map<wire::CampaignId, WantedDefinition> wanted_;  ///< Definitions that runs wait for.
  std::map<RunKey, wire::Attempt> unfinished_;           ///< All runs that the execution has.
  UnacknowledgedResults unacknowledged_;
  std::vector<wire::Event> events_;
  std::optional<Leaving> leaving_;
  std::optional<Ending> ending_;
};

}  // namespace proofmass::worker
