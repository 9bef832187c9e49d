#include "worker/net/conversation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "core/runs.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

std::int64_t whole_seconds(Duration duration) {
  return std::chrono::duration_cast<std::chrono::seconds>(duration).count();
}

}  // namespace

Conversation::Conversation(wire::SessionId session, proto::Hello hello, Execution& execution,
                           Send send, TimePoint now, const ConversationConfig& config)
    : session_(session),
      hello_(std::move(hello)),
      execution_(execution),
      send_(std::move(send)),
      config_(config),
      heard_at_(now),
      busy_at_(now),
      refusal_delay_(config.refusal_delay),
      refused_at_(now),
      unacknowledged_(config.resend_after, config.resend_after_max) {
  PROOFMASS_EXPECT(session.value != 0);
  register_again(now);
}

// What arrives.

void Conversation::on_welcome(const proto::Envelope& message, TimePoint now) {
  if (is_registered_) return;  // The answer to a repeated Hello.
  is_registered_ = true;
  refusal_.clear();
  // The coordinator process that asked for the drain has ended; this one may need the worker.
  const bool is_drained = leaving_ && leaving_->reason == wire::LossReason::drained;
  if (is_drained && message.epoch() != epoch_.value) leaving_.reset();
  epoch_ = {message.epoch()};
  welcome_sequence_ = message.sequence();
  noted_refusals_.clear();
  revocation_.reset();
  heartbeat_interval_ = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(message.welcome().heartbeat_interval_s()));
  send_heartbeat(now);
  send_all_results(now);
}

void Conversation::on_reject(const proto::Envelope& message, TimePoint now) {
  const proto::Reject& reject = message.reject();
  // One that was overtaken by the Welcome after it.
  const bool is_late = message.epoch() == epoch_.value && message.sequence() < welcome_sequence_;
  if (is_registered_ && is_late) return;
  if (reject.reason() == proto::REJECT_REASON_NOT_REGISTERED) {
    if (is_registered_) register_again(now);  // Otherwise a Hello is under way.
    return;
  }
  if (reject.reason() == proto::REJECT_REASON_INCOMPATIBLE) {
    return end(Ending::Kind::failed, "refused by the coordinator: " + reject.text());
  }
  const bool is_revoked = reject.reason() == proto::REJECT_REASON_REVOKED;
  if (is_revoked && !revocation_) revocation_.emplace(now, reject.text());
  come_again(reject, now);
}

void Conversation::on_definition_part(const proto::DefinitionPart& part, TimePoint now) {
  using Progress = wire::IncomingDefinition::Progress;
  const wire::CampaignId campaign{part.campaign()};
  const auto wanted = wanted_.find(campaign);
  if (wanted == wanted_.end()) return;
  const Progress progress = wanted->second.incoming.add(part);
  if (progress == Progress::advanced) return request(campaign, now);
  if (progress == Progress::complete) define(campaign, now);
}

void Conversation::on_forget(const proto::Forget& forget) {
  const wire::CampaignId campaign{forget.campaign()};
  const RunRange known{{0}, forget.num_runs()};
  for (const RunIndex run : execution_.drop_waiting(campaign, std::array{known})) {
    unfinished_.erase({campaign, run});
  }
  // What is computed from num_runs on is of an extension, and goes on.
  const auto next = unfinished_.lower_bound({campaign, RunIndex{forget.num_runs()}});
  if (next == unfinished_.end() || next->first.first != campaign) {
    std::erase_if(unfinished_, [&](const auto& entry) { return entry.first.first == campaign; });
    wanted_.erase(campaign);
    table_widths_.erase(campaign);
    execution_.forget(campaign);
  }
  if (const std::size_t count = unacknowledged_.drop(campaign, known); count > 0) {
    note(wire::Event::warning("results_forgotten",
                              {{"campaign", fmt::format("{:016x}", campaign.value)},
                               {"results", count},
                               wire::Field::remark("(finished or cancelled)")}));
  }
  leave_if_done();
}

void Conversation::on_not_served(const proto::NotServed& not_served) {
  const wire::CampaignId campaign{not_served.campaign()};
  std::vector<RunRange> ranges = wire::ranges_of(not_served.ranges());
  if (ranges.empty()) ranges.push_back(all_runs);
  give_back(wire::LossReason::retracted, campaign, execution_.drop_waiting(campaign, ranges));
  set_aside(campaign, ranges);
}

void Conversation::on_lease(const proto::RunLease& lease, TimePoint now) {
  if (!is_registered_) return;
  const wire::CampaignId campaign{lease.campaign()};
  const std::vector<RunRange> ranges = new_runs(lease);
  const std::vector<RunIndex> runs = indices_of(ranges);
  const auto num_values = static_cast<std::size_t>(lease.table_values_size());
  if (!leaving_ && !agrees_on_table(campaign, num_values / lease.num_runs())) return;
  for (const RunIndex run : runs) unfinished_[{campaign, run}] = {lease.attempt()};
  if (leaving_) return give_back(leaving_->reason, campaign, runs);
  if (!ranges.empty()) execution_.submit(lease, ranges);
  const bool is_wanted = wanted_.contains(campaign);
  if (!execution_.is_defined(campaign) && !is_wanted) request(campaign, now);
}

void Conversation::on_message(const proto::Envelope& message, TimePoint now) {
  // Who is refused before a session could be read is told so with another one.
  if (ending_ || (message.session() != session_.value && !message.has_reject())) return;
  heard_at_ = now;
  const bool is_about_registration = message.has_reject() || message.has_welcome();
  // What another coordinator process has said before it ended means nothing to the present one.
  if (!is_about_registration && message.epoch() != epoch_.value) return;
  switch (message.from_coordinator_case()) {
    case proto::Envelope::kWelcome:
      return on_welcome(message, now);
    case proto::Envelope::kReject:
      return on_reject(message, now);
    case proto::Envelope::kDefinitionPart:
      return on_definition_part(message.definition_part(), now);
    case proto::Envelope::kForget:
      return on_forget(message.forget());
    case proto::Envelope::kNotServed:
      return on_not_served(message.not_served());
    case proto::Envelope::kRunLease:
      return on_lease(message.run_lease(), now);
    case proto::Envelope::kRetract: {
      const wire::CampaignId campaign{message.retract().campaign()};
      const std::vector<RunRange> ranges = wire::ranges_of(message.retract().ranges());
      return give_back(wire::LossReason::retracted, campaign,
                       execution_.drop_waiting(campaign, ranges));
    }
    case proto::Envelope::kResultAck:
      unacknowledged_.drop({message.result_ack().campaign()}, wire::runs_of(message.result_ack()));
      return leave_if_done();
    case proto::Envelope::kDrain:
      if (!leaving_) begin_to_leave({.reason = wire::LossReason::drained, .deadline = {}}, now);
      return;
    case proto::Envelope::kStop:
      execution_.abandon();
      return end(Ending::Kind::done, "told to stop");
    case proto::Envelope::kHeartbeatAck:
      return;
    case proto::Envelope::FROM_COORDINATOR_NOT_SET:
      return;  // What only workers say is none of its business.
  }
}

// What happens here.

void Conversation::on_connected(TimePoint now) {
  if (ending_) return;
  refusal_.clear();
  if (!is_registered_) return register_again(now);
  send_heartbeat(now);
  send_all_results(now);
}

void Conversation::on_refused(const std::string& reason) { refusal_ = reason; }

void Conversation::on_progress(TimePoint now) {
  if (ending_) return;
  const std::vector<RunKey> runs = keep_finished(now);
  for (const CrashedBatch& batch : execution_.take_crashed()) {
    note(wire::Event::error("simulation_crashed", {{"first_run", batch.runs.front().value},
                                                   {"runs", batch.runs.size()},
                                                   wire::Field::reason(batch.reason)}));
    give_back(wire::LossReason::crashed, batch.campaign, batch.runs);
  }
  if (const auto failure = execution_.failure()) {
    say_bye(wire::LossReason::failed);
    return end(Ending::Kind::failed, *failure);
  }
  if (is_registered_) send_results(unacknowledged_.take(runs, now));
  leave_if_done();
}

void Conversation::on_tick(TimePoint now) {
  if (ending_) return;
  if (silence(now) >= config_.give_up_after) {
    return end(Ending::Kind::failed,
               fmt::format("coordinator = silent for {} s ({})", whole_seconds(silence(now)),
                           why_not_registered()));
  }
  if (revocation_ && now - revocation_->first >= config_.refusal_memory) {
    return end(Ending::Kind::failed, "refused by the coordinator: " + revocation_->second);
  }
  watch_time(now);
  watch_idleness(now);
  if (ending_) return;
  if (!is_registered_) {
    if (now < hello_due_at_) return;
    if (std::exchange(is_closed_out_, false)) {
      wants_connection_ = true;
      hello_due_at_ = now + hello_delay_;  // Unless on_connected() comes first.
      return;
    }
    return say_hello(now);
  }
  request_definitions(now);
  send_results(unacknowledged_.take_due(now));  // The next tick has what exceeds one message.
  const Duration since_heartbeat = now - heartbeat_at_;
  const bool has_news = since_heartbeat >= config_.news_interval && computes_other_batches();
  if (has_news || since_heartbeat >= heartbeat_interval_) send_heartbeat(now);
}

// Registration.

std::string Conversation::why_not_registered() const {
  return refusal_.empty() ? "is it running, and is this its address for workers?" : refusal_;
}

void Conversation::send(proto::Envelope message) {
  message.set_session(session_.value);
  message.set_epoch(message.has_hello() ? 0 : epoch_.value);
  message.set_sequence(++num_sent_);
  send_(std::move(message));
}

Duration Conversation::with_jitter(Duration delay) const {
  const double jitter = 0.25 * fraction_of(mixed(session_.value + num_sent_));
  return std::chrono::duration_cast<Duration>((1.0 + jitter) * delay);
}

void Conversation::register_again(TimePoint now) {
  is_registered_ = false;
  hello_delay_ = config_.hello_delay;
  say_hello(now);
}

/// What stands in the way may pass: there are too many workers, a person releases the host, or the
/// list of keys was cut off for a moment.
void Conversation::come_again(const proto::Reject& reject, TimePoint now) {
  if (std::exchange(is_refused_, true)) return;  // The answer to a repeated Hello.
  if (now - refused_at_ >= config_.refusal_memory) refusal_delay_ = config_.refusal_delay;
  refused_at_ = now;
  is_registered_ = false;
  refusal_ = reject.text();
  is_closed_out_ = reject.reason() == proto::REJECT_REASON_MALFORMED || revocation_;
  hello_due_at_ = now + with_jitter(refusal_delay_);
  hello_delay_ = config_.hello_delay;
  refusal_delay_ = std::min(2 * refusal_delay_, config_.refusal_delay_max);
  if (!noted_refusals_.insert(reject.reason()).second) return;
  const std::string how =
      fmt::format("(asks again every {} to {} s)", whole_seconds(config_.refusal_delay),
                  whole_seconds(config_.refusal_delay_max));
  note(wire::Event::error("refused",
                          {wire::Field::reason(reject.text()), wire::Field::remark(how)}));
}

void Conversation::say_hello(TimePoint now) {
  is_refused_ = false;
  proto::Envelope envelope;
  *envelope.mutable_hello() = hello_;
  send(std::move(envelope));
  hello_due_at_ = now + with_jitter(hello_delay_);
  hello_delay_ = std::min(2 * hello_delay_, config_.hello_delay_max);
}

/// What is not acknowledged counts against the credit, so that a coordinator that cannot store
/// results does not fill this worker's memory. What is set aside takes half of it at most, as long
/// as there is room, so that the worker goes on with other campaigns.
std::uint32_t Conversation::credit() const {
  if (leaving_) return 0;
  const std::size_t credit_max = std::clamp<std::size_t>(
      2 * std::size_t{hello_.num_slots()}, wire::runs_per_lease_max, wire::runs_held_max);
  const std::size_t num_kept = unacknowledged_.size();
  const std::size_t num_aside = unacknowledged_.num_set_aside();
  const std::size_t used = num_kept - num_aside + std::min(num_aside, credit_max / 2);
  const std::size_t room = config_.num_kept_max - std::min(config_.num_kept_max, num_kept);
  return static_cast<std::uint32_t>(std::min(room, credit_max - std::min(credit_max, used)));
}

void Conversation::send_heartbeat(TimePoint now) {
  heartbeat_at_ = now;
  std::vector<HeldRun> held;
  std::vector<HeldRun> aside;
  held.reserve(unfinished_.size() + unacknowledged_.size());
  for (const auto& [key, attempt] : unfinished_) held.push_back({key.first, attempt, key.second});
  unacknowledged_.list(held, aside);
  proto::Envelope envelope;
  proto::Heartbeat& heartbeat = *envelope.mutable_heartbeat();
  heartbeat.set_num_runs_max(credit());
  heartbeat.set_num_steps_done(execution_.num_steps_done());
  *heartbeat.mutable_held() = grouped(std::move(held), wire::ranges_per_message_max);
  // Runs that are not listed here may be lent to others as well; runs not listed above are.
  const std::size_t room = wire::ranges_per_message_max - num_ranges(heartbeat.held());
  *heartbeat.mutable_set_aside() = grouped(std::move(aside), room);
  reported_batches_.clear();
  // What is not listed is blamed for no crash; a card's runs may lie apart.
  std::size_t room_of_batches = wire::ranges_per_message_max;
  for (const RunningBatch& batch : execution_.computing()) {
    reported_batches_.push_back(batch.number);
    if (batch.ranges.size() > room_of_batches) continue;
    room_of_batches -= batch.ranges.size();
    proto::ComputedBatch& message = *heartbeat.add_computing();
    message.set_campaign(batch.campaign.value);
    message.set_num_steps_done(batch.num_steps_done);
    wire::add_ranges(batch.ranges, *message.mutable_ranges());
  }
  send(std::move(envelope));
}

/// If the process crashes, the runs that were being computed are blamed: the coordinator should
/// know which.
bool Conversation::computes_other_batches() const {
  const std::vector<RunningBatch> batches = execution_.computing();
  return !std::ranges::equal(batches, reported_batches_, {}, &RunningBatch::number);
}

// Campaigns and leases.

void Conversation::request(wire::CampaignId campaign, TimePoint now) {
  WantedDefinition& wanted = wanted_[campaign];
  wanted.request_due_at = now + config_.request_interval;
  proto::Envelope envelope;
  envelope.mutable_campaign_request()->set_campaign(campaign.value);
  envelope.mutable_campaign_request()->set_offset(wanted.incoming.num_bytes());
  send(std::move(envelope));
}

void Conversation::request_definitions(TimePoint now) {
  const auto has_no_run = [&](const auto& entry) {
    const auto first = unfinished_.lower_bound({entry.first, RunIndex{0}});
    return first == unfinished_.end() || first->first.first != entry.first;
  };
  std::erase_if(wanted_, has_no_run);
  for (const auto& [campaign, wanted] : wanted_) {
    if (now >= wanted.request_due_at) request(campaign, now);
  }
}

/// A definition that makes no sense, though the protocol is the same, is a fault of the
/// coordinator's program. It is asked for again in a while, as the program may be exchanged.
void Conversation::define(wire::CampaignId campaign, TimePoint now) {
  WantedDefinition& wanted = wanted_.at(campaign);
  std::shared_ptr<const Campaign> definition;
  try {
    definition = execution_.read(wanted.incoming.take());
  } catch (const Error& error) {
    wanted.request_due_at = now + config_.request_again_after;
    return note(wire::Event::error("malformed_definition",
                                   {{"campaign", fmt::format("{:016x}", campaign.value)},
                                    wire::Field::remark(fmt::format("{:.400}", error.what()))}));
  }
  wanted_.erase(campaign);
  if (agrees_on_table(campaign, definition->table_quantities().size())) {
    execution_.define(campaign, definition);
  }
}

/// Every lease and the definition of a campaign must have the same number of table values a run.
bool Conversation::agrees_on_table(wire::CampaignId campaign, std::size_t width) {
  const std::size_t expected = table_widths_.try_emplace(campaign, width).first->second;
  if (width == expected) return true;
  execution_.abandon();
  end(Ending::Kind::failed,
      fmt::format("table_values = {} for each run (must be {})", width, expected));
  return false;
}

/// Those runs of the lease that are not here. Of the others, the attempt may have grown: they were
/// taken from this worker and lent to it again.
std::vector<RunRange> Conversation::new_runs(const proto::RunLease& lease) {
  std::vector<RunIndex> runs;
  for (const RunIndex run : indices_of(std::array{wire::runs_of(lease)})) {
    const RunKey key{{lease.campaign()}, run};
    const auto found = unfinished_.find(key);
    if (found != unfinished_.end()) {
      found->second = std::max(found->second, wire::Attempt{lease.attempt()});
    } else if (!unacknowledged_.contains(key)) {
      runs.push_back(run);
    }
  }
  return ranges_of(runs);
}

// Results.

void Conversation::restore(std::vector<wire::LeasedResult> results) {
  for (wire::LeasedResult& result : results) {
    unacknowledged_.add(std::move(result), TimePoint::min());
  }
}

void Conversation::set_aside(wire::CampaignId campaign, std::span<const RunRange> ranges) {
  const std::size_t count = unacknowledged_.set_aside(campaign, ranges);
  if (count == 0) return;
  note(wire::Event::warning("results_set_aside",
                            {{"campaign", fmt::format("{:016x}", campaign.value)},
                             {"results", count},
                             wire::Field::remark("(not served now)")}));
}

std::vector<RunKey> Conversation::keep_finished(TimePoint now) {
  std::vector<RunKey> runs;
  for (wire::LeasedResult& finished : execution_.take_finished()) {
    const RunKey key{finished.campaign, finished.computed.result.run};
    const auto found = unfinished_.find(key);
    PROOFMASS_EXPECT(found != unfinished_.end());
    finished.attempt = found->second;
    unacknowledged_.add(std::move(finished), now);
    unfinished_.erase(found);
    runs.push_back(key);
  }
  return runs;
}

void Conversation::send_results(std::vector<proto::ResultBatch> batches) {
  for (proto::ResultBatch& batch : batches) {
    proto::Envelope envelope;
    *envelope.mutable_result_batch() = std::move(batch);
    send(std::move(envelope));
  }
}

void Conversation::send_all_results(TimePoint now) {
  unacknowledged_.make_due(now);
  send_results(unacknowledged_.take_due(now));
}

void Conversation::give_back(wire::LossReason reason, wire::CampaignId campaign,
                             std::span<const RunIndex> runs) {
  std::vector<HeldRun> held;
  for (const RunIndex run : runs) {
    const auto found = unfinished_.find({campaign, run});
    PROOFMASS_EXPECT(found != unfinished_.end());
    held.push_back({campaign, found->second, run});
    unfinished_.erase(found);
  }
  // Without a registration, the next heartbeat says the same by not naming them.
  if (held.empty() || !is_registered_) return;
  proto::Envelope envelope;
  proto::GiveBack& answer = *envelope.mutable_give_back();
  answer.set_reason(wire::message_value(reason));
  *answer.mutable_runs() = grouped(std::move(held), wire::ranges_per_message_max);
  send(std::move(envelope));
}

}  // namespace proofmass::worker
