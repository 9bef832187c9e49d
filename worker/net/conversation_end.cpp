#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "core/math/hash.hpp"
#include "core/runs.hpp"
#include "proto/wire/codec.hpp"
#include "worker/net/conversation.hpp"

// How a conversation ends. While it does, it takes no more runs.

namespace proofmass::worker {
void Conversation::on_drain_request(TimePoint now) {
  if (ending_) return;
  TimePoint deadline = now + config_.drain_time;
  if (config_.walltime_end) deadline = std::min(deadline, walltime_deadline());
  leave_by(deadline, wire::LossReason::preempted, now);
}

void Conversation::on_abandon_request() {
  if (ending_) return;
  if (!leaving_) leaving_ = {.reason = wire::LossReason::preempted, .deadline = {}};
  execution_.abandon();
  leave("asked to end at once");
}

void Conversation::watch_time(TimePoint now) {
  if (config_.walltime_end && now + time_to_leave() >= *config_.walltime_end) {
    leave_by(walltime_deadline(), wire::LossReason::walltime, now);
  }
  if (ending_ || !leaving_ || !leaving_->deadline) return;
  give_back_late_batches(now);
  leave_if_done();
  if (!ending_ && now >= *leaving_->deadline) {
    execution_.abandon();
    leave(fmt::format("out of time with {} results not acknowledged", unacknowledged_.size()));
  }
}

void Conversation::watch_idleness(TimePoint now) {
  if (ending_ || leaving_ || !config_.idle_timeout) return;
  if (!unfinished_.empty() || unacknowledged_.size() > 0) busy_at_ = now;
  if (now - busy_at_ < *config_.idle_timeout) return;
  leaving_ = Leaving{};
  leave_unneeded(fmt::format(
      "no run for {} s", std::chrono::duration_cast<std::chrono::seconds>(now - busy_at_).count()));
}

/// Half again of the usual time of a batch, so that one that begins now is finished; and up to
/// once more, for each worker another part of it: those of one job end at the same time, and shall
/// not all give back and deliver at once.
Duration Conversation::time_to_leave() const {
  const Duration usual = execution_.usual_batch_time().value_or(Duration::zero());
  const double share = fraction_of(mixed(session_.value));
  return usual + usual / 2 + std::chrono::duration_cast<Duration>(share * usual) +
         2 * config_.delivery_time;
}

TimePoint Conversation::walltime_deadline() const {
  return *config_.walltime_end - config_.delivery_time;
}

/// Whoever asks first, the earliest deadline holds: a drain gives no time beyond the walltime, nor
/// the walltime beyond a drain.
void Conversation::leave_by(TimePoint deadline, wire::LossReason reason, TimePoint now) {
  if (leaving_ && leaving_->deadline && *leaving_->deadline <= deadline) return;
  begin_to_leave({.reason = reason, .deadline = deadline}, now);
}

void Conversation::begin_to_leave(const Leaving& leaving, TimePoint now) {
  leaving_ = leaving;
  // First that it wants no runs, or it is lent again what it gives back.
  if (is_registered_) send_heartbeat(now);
  if (leaving.deadline) give_back_waiting();
  leave_if_done();
}

void Conversation::give_back_waiting() {
  for (auto entry = unfinished_.begin(); entry != unfinished_.end();) {
    const wire::CampaignId campaign = entry->first.first;
    give_back(leaving_->reason, campaign, execution_.drop_waiting(campaign, std::array{all_runs}));
    entry = unfinished_.upper_bound({campaign, RunIndex{num_runs_max}});
  }
}

void Conversation::give_back_late_batches(TimePoint now) {
  const TimePoint finished_by = *leaving_->deadline - config_.delivery_time;
  for (const RunningBatch& batch : execution_.computing()) {
    const bool is_late =
        now >= finished_by || (batch.time_left && now + *batch.time_left > finished_by);
    if (!is_late || !execution_.drop_batch(batch.number)) continue;
    give_back(leaving_->reason, batch.campaign, indices_of(batch.ranges));
  }
}

void Conversation::leave_if_done() {
  if (ending_ || !leaving_ || !unfinished_.empty() || !unacknowledged_.empty()) return;
  const wire::LossReason reason = leaving_->reason;
  if (reason == wire::LossReason::walltime) return leave_unneeded("its time is up");
  leave(reason == wire::LossReason::drained ? "drained" : "asked to end");
}

/// A worker that no coordinator has ever registered has not done what it was started for, which a
/// batch system is to see.
void Conversation::leave_unneeded(const std::string& reason) {
  if (epoch_.value != 0) return leave(reason);
  end(Ending::Kind::failed, fmt::format("{}, and no coordinator has taken this worker ({})", reason,
                                        why_not_registered()));
}

void Conversation::leave(const std::string& reason) {
  say_bye(leaving_->reason);
  end(Ending::Kind::done, reason);
}

void Conversation::say_bye(wire::LossReason reason) {
  if (!is_registered_) return;
  proto::Envelope envelope;
  envelope.mutable_bye()->set_reason(wire::message_value(reason));
  send(std::move(envelope));
}

/// As many as a log can take in at a time; the caller takes them at once.
void Conversation::note(wire::Event event) {
  constexpr std::size_t events_max = 100;
  if (events_.size() < events_max) events_.push_back(std::move(event));
}

void Conversation::end(Ending::Kind kind, std::string reason) {
  ending_ = Ending{.kind = kind, .reason = std::move(reason)};
}

}  // namespace proofmass::worker
