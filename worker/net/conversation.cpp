#include "worker/net/conversation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

/// Equal for equal campaigns.
std::string bytes_of(const std::shared_ptr<const Campaign>& campaign) {
  return wire::encode(
      wire::Welcome{.worker = {1}, .heartbeat_interval_s = 1.0, .campaign = campaign});
}

}  // namespace

Conversation::Conversation(wire::Hello hello, Execution& execution, Send send, TimePoint now,
                           const ConversationConfig& config)
    : hello_(std::move(hello)),
      execution_(execution),
      send_(std::move(send)),
      config_(config),
      heard_at_(now) {
  say_hello(now);
}

void Conversation::on_message(const wire::Message& message, TimePoint now) {
  if (ending_) return;
  heard_at_ = now;
  std::visit([&](const auto& content) { handle(content, now); }, message);
}

void Conversation::on_connected(TimePoint now) {
  if (!ending_ && !is_registered_) say_hello(now);
}

void Conversation::handle(const wire::Welcome& welcome, TimePoint now) {
  if (is_registered_) return;  // The answer to a repeated Hello.
  std::string bytes = bytes_of(welcome.campaign);
  if (campaign_bytes_.empty()) {
    execution_.start(welcome.campaign);
    table_width_ = table_elements(welcome.campaign->dispersions).size();
    campaign_bytes_ = std::move(bytes);
  } else if (campaign_bytes_ != bytes) {
    return end(Ending::Kind::failed, "the coordinator serves another campaign now");
  }
  is_registered_ = true;
  heartbeat_interval_ = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(welcome.heartbeat_interval_s));
  resend_results(now, Duration::zero());
  send_heartbeat(now);
}

void Conversation::handle(const wire::Reject& reject, TimePoint now) {
  if (reject.reason != wire::RejectReason::not_registered) {
    return end(Ending::Kind::failed, "refused by the coordinator: " + reject.text);
  }
  if (!is_registered_) return;  // A Hello is under way.
  is_registered_ = false;
  execution_.abandon();  // The runs will be lent again; a new registration begins with none.
  say_hello(now);
}

void Conversation::handle(const wire::RunLease& lease, TimePoint) {
  if (!is_registered_ || is_draining_) return;
  const std::vector<wire::LeaseId> open = execution_.open_leases();
  if (std::find(open.begin(), open.end(), lease.lease) != open.end()) return;
  if (lease.table_values.size() != lease.runs.count * table_width_) {
    return end(Ending::Kind::failed,
               fmt::format("table_values = {} entries (must be {} for each run)",
                           lease.table_values.size(), table_width_));
  }
  execution_.submit(lease);
}

void Conversation::handle(const wire::ResultAck& ack, TimePoint) {
  for (const RunIndex run : ack.runs) unacknowledged_.erase(run);
  leave_if_drained();
}

void Conversation::handle(const wire::Drain&, TimePoint) {
  is_draining_ = true;
  send_credit();
  leave_if_drained();
}

void Conversation::handle(const wire::Stop&, TimePoint) {
  execution_.abandon();
  end(Ending::Kind::done, "told to stop");
}

void Conversation::on_progress(TimePoint now) {
  if (ending_) return;
  if (const auto failure = execution_.failure()) {
    send_(wire::Bye{});
    return end(Ending::Kind::failed, *failure);
  }
  std::vector<SentRun*> runs;
  for (FinishedRun& finished : execution_.take_finished()) {
    const RunIndex run = finished.computed.result.run;
    SentRun& sent = unacknowledged_[run];
    sent.finished = std::move(finished);
    runs.push_back(&sent);
  }
  send_results(std::move(runs), now);
}

void Conversation::on_tick(TimePoint now) {
  if (ending_) return;
  if (now - heard_at_ >= config_.unreachable_after) {
    return end(
        Ending::Kind::failed,
        fmt::format("coordinator = silent for {} s (is it running?)",
                    std::chrono::duration_cast<std::chrono::seconds>(now - heard_at_).count()));
  }
  if (!is_registered_) {
    if (now - hello_at_ >= config_.hello_interval) say_hello(now);
    return;
  }
  resend_results(now, config_.resend_after);
  if (now - heartbeat_at_ >= heartbeat_interval_) send_heartbeat(now);
  leave_if_drained();
}

void Conversation::on_stop_request() {
  if (ending_) return;
  execution_.abandon();
  send_(wire::Bye{});
  end(Ending::Kind::done, "asked to stop");
}

void Conversation::say_hello(TimePoint now) {
  hello_at_ = now;
  send_(hello_);
}

/// What is not acknowledged counts against the credit, so that a coordinator that cannot store
/// results does not fill this worker's memory.
void Conversation::send_credit() {
  const std::size_t kept = std::min<std::size_t>(unacknowledged_.size(), wire::runs_per_lease_max);
  const auto num_runs_max = static_cast<std::uint32_t>(wire::runs_per_lease_max - kept);
  send_(wire::Credit{.num_runs_max = is_draining_ ? 0 : num_runs_max});
}

/// Credit goes with every heartbeat: one that is lost is made good by the next.
void Conversation::send_heartbeat(TimePoint now) {
  heartbeat_at_ = now;
  std::vector<wire::LeaseId> leases = execution_.open_leases();
  for (const auto& [run, sent] : unacknowledged_) leases.push_back(sent.finished.lease);
  std::sort(leases.begin(), leases.end());
  leases.erase(std::unique(leases.begin(), leases.end()), leases.end());
  leases.resize(std::min(leases.size(), wire::leases_held_max));
  send_(wire::Heartbeat{.num_orbits_done = execution_.num_orbits_done(),
                        .leases = std::move(leases)});
  send_credit();
}

/// One message for each lease, with its runs in order.
void Conversation::send_results(std::vector<SentRun*> runs, TimePoint now) {
  std::map<wire::LeaseId, wire::ResultBatch> batches;
  for (SentRun* const run : runs) {
    run->sent_at = now;
    const FinishedRun& finished = run->finished;
    wire::ResultBatch& batch = batches[finished.lease];
    batch.lease = finished.lease;
    batch.attempt = finished.attempt;
    batch.results.push_back(finished.computed);
    if (batch.results.size() < wire::runs_per_lease_max) continue;
    send_(batch);
    batches.erase(finished.lease);
  }
  for (const auto& [lease, batch] : batches) send_(batch);
}

void Conversation::resend_results(TimePoint now, Duration older_than) {
  std::vector<SentRun*> runs;
  for (auto& [run, sent] : unacknowledged_) {
    if (now - sent.sent_at >= older_than) runs.push_back(&sent);
  }
  send_results(std::move(runs), now);
}

void Conversation::leave_if_drained() {
  if (ending_ || !is_draining_ || !unacknowledged_.empty()) return;
  if (!execution_.open_leases().empty()) return;
  send_(wire::Bye{});
  end(Ending::Kind::done, "drained");
}

void Conversation::end(Ending::Kind kind, std::string reason) {
  ending_ = Ending{.kind = kind, .reason = std::move(reason)};
}

}  // namespace proofmass::worker
