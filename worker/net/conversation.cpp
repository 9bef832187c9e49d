#include "worker/net/conversation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "core/runs.hpp"

namespace proofmass::worker {
namespace {

Duration times(double factor, Duration duration) {
  return std::chrono::duration_cast<Duration>(factor * duration);
}

std::int64_t whole_seconds(Duration duration) {
  return std::chrono::duration_cast<std::chrono::seconds>(duration).count();
}

/// The table values of some of a lease's runs.
std::vector<double> values_of(const wire::RunLease& lease, RunRange runs, std::size_t width) {
  const auto first =
      lease.table_values.begin() +
      static_cast<std::ptrdiff_t>((runs.first.value - lease.runs.first.value) * width);
  return {first, first + static_cast<std::ptrdiff_t>(runs.count * width)};
}

/// The campaign that was received, or why it is none.
std::variant<std::shared_ptr<const Campaign>, std::string> read_definition(
    const Execution& execution, std::variant<Definition, wire::DecodeError> taken) {
  if (auto* const error = std::get_if<wire::DecodeError>(&taken)) return std::move(error->text);
  try {
    return execution.read(std::get<Definition>(std::move(taken)));
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace

Conversation::Conversation(wire::SessionId session, wire::Hello hello, Execution& execution,
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

template <>
void Conversation::handle(const wire::Welcome& welcome, const wire::Header& header, TimePoint now) {
  if (is_registered_) return;  // The answer to a repeated Hello.
  is_registered_ = true;
  // The coordinator process that asked for the drain has ended; this one may need the worker.
  const bool is_drained = leaving_ && leaving_->reason == wire::LossReason::drained;
  if (is_drained && header.epoch != epoch_) leaving_.reset();
  epoch_ = header.epoch;
  welcome_sequence_ = header.sequence;
  noted_refusals_.clear();
  revocation_.reset();
  heartbeat_interval_ = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(welcome.heartbeat_interval_s));
  send_heartbeat(now);
  send_all_results(now);
}

template <>
void Conversation::handle(const wire::Reject& reject, const wire::Header& header, TimePoint now) {
  // One that was overtaken by the Welcome after it.
  const bool is_late = header.epoch == epoch_ && header.sequence < welcome_sequence_;
  if (is_registered_ && is_late) return;
  switch (reject.reason) {
    case wire::RejectReason::not_registered:
      if (is_registered_) register_again(now);  // Otherwise a Hello is under way.
      return;
    case wire::RejectReason::incompatible:
      return end(Ending::Kind::failed, "refused by the coordinator: " + reject.text);
    case wire::RejectReason::revoked:
      if (!revocation_) revocation_.emplace(now, reject.text);
      return come_again(reject, now);
    case wire::RejectReason::malformed:
    case wire::RejectReason::full:
    case wire::RejectReason::quarantined:
      return come_again(reject, now);
  }
}

template <>
void Conversation::handle(const wire::DefinitionPart& part, const wire::Header&, TimePoint now) {
  using Progress = wire::IncomingDefinition::Progress;
  const auto wanted = wanted_.find(part.campaign);
  if (wanted == wanted_.end()) return;
  const Progress progress = wanted->second.incoming.add(part);
  if (progress == Progress::advanced) return request(part.campaign, now);
  if (progress == Progress::complete) define(part.campaign, now);
}

template <>
void Conversation::handle(const wire::Forget& forget, const wire::Header&, TimePoint) {
  const RunRange known{{0}, forget.num_runs};
  for (const RunIndex run : execution_.drop_waiting(forget.campaign, std::array{known})) {
    unfinished_.erase({forget.campaign, run});
  }
  // What is computed from num_runs on is of an extension, and goes on.
  const auto next = unfinished_.lower_bound({forget.campaign, RunIndex{forget.num_runs}});
  if (next == unfinished_.end() || next->first.first != forget.campaign) {
    std::erase_if(unfinished_,
                  [&](const auto& entry) { return entry.first.first == forget.campaign; });
    wanted_.erase(forget.campaign);
    table_widths_.erase(forget.campaign);
    execution_.forget(forget.campaign);
  }
  if (const std::size_t count = unacknowledged_.drop(forget.campaign, known); count > 0) {
    note({.severity = wire::Severity::warning,
          .kind = "results_forgotten",
          .fields = {{"campaign", fmt::format("{:016x}", forget.campaign.value)},
                     {"results", count},
                     wire::Field::remark("(finished or cancelled)")}});
  }
  leave_if_done();
}

template <>
void Conversation::handle(const wire::NotServed& not_served, const wire::Header&, TimePoint) {
  std::vector<RunRange> ranges = not_served.ranges;
  if (ranges.empty()) ranges.push_back(all_runs);
  give_back(wire::LossReason::retracted, not_served.campaign,
            execution_.drop_waiting(not_served.campaign, ranges));
  set_aside(not_served.campaign, ranges);
}

template <>
void Conversation::handle(const wire::RunLease& lease, const wire::Header&, TimePoint now) {
  if (!is_registered_) return;
  const std::size_t width = lease.table_values.size() / lease.runs.count;
  const std::vector<RunRange> ranges = new_runs(lease);
  if (leaving_) {
    if (ranges.empty()) return;
    return send(wire::GiveBack{leaving_->reason, {{lease.campaign, lease.attempt, ranges}}});
  }
  if (!agrees_on_table(lease.campaign, width)) return;
  for (const RunRange& runs : ranges) {
    wire::RunLease part = lease;
    part.runs = runs;
    part.table_values = values_of(lease, runs, width);
    execution_.submit(std::move(part));
    for (const RunIndex run : indices_of(std::array{runs}))
      unfinished_[{lease.campaign, run}] = lease.attempt;
  }
  const bool is_wanted = wanted_.contains(lease.campaign);
  if (!execution_.is_defined(lease.campaign) && !is_wanted) request(lease.campaign, now);
}

template <>
void Conversation::handle(const wire::Retract& retract, const wire::Header&, TimePoint) {
  give_back(wire::LossReason::retracted, retract.campaign,
            execution_.drop_waiting(retract.campaign, retract.ranges));
}

template <>
void Conversation::handle(const wire::ResultAck& ack, const wire::Header&, TimePoint) {
  unacknowledged_.drop(ack.campaign, ack.runs);
  leave_if_done();
}

template <>
void Conversation::handle(const wire::Drain&, const wire::Header&, TimePoint now) {
  if (!leaving_) begin_to_leave({.reason = wire::LossReason::drained, .deadline = {}}, now);
}

template <>
void Conversation::handle(const wire::Stop&, const wire::Header&, TimePoint) {
  execution_.abandon();
  end(Ending::Kind::done, "told to stop");
}

template <>
void Conversation::handle(const wire::HeartbeatAck&, const wire::Header&, TimePoint) {}

void Conversation::on_packet(const wire::Packet& packet, TimePoint now) {
  // Who is refused before a session could be read is told so with another one.
  const bool is_reject = std::holds_alternative<wire::Reject>(packet.message);
  if (ending_ || (packet.header.session != session_ && !is_reject)) return;
  heard_at_ = now;
  const bool is_about_registration =
      is_reject || std::holds_alternative<wire::Welcome>(packet.message);
  // What another coordinator process has said before it ended means nothing to the present one.
  if (!is_about_registration && packet.header.epoch != epoch_) return;
  // What only workers say is none of its business.
  (void)wire::visit_if<wire::CoordinatorMessage>(
      packet.message, [&](const auto& content) { handle(content, packet.header, now); });
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
  if (const auto failure = execution_.failure()) {
    if (is_registered_) send(wire::Bye{wire::LossReason::failed});
    return end(Ending::Kind::failed, *failure);
  }
  if (is_registered_) send_results(unacknowledged_.take(runs, now));
  leave_if_done();
}

void Conversation::on_tick(TimePoint now) {
  if (ending_) return;
  if (now - heard_at_ >= config_.give_up_after) {
    return end(Ending::Kind::failed,
               fmt::format("coordinator = silent for {} s ({})", whole_seconds(now - heard_at_),
                           refusal_.empty() ? "is it running?" : refusal_));
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

void Conversation::send(wire::Message message) {
  const bool is_hello = std::holds_alternative<wire::Hello>(message);
  send_({.header = {.session = session_,
                    .epoch = is_hello ? wire::Epoch{} : epoch_,
                    .sequence = ++num_sent_},
         .message = std::move(message)});
}

void Conversation::register_again(TimePoint now) {
  is_registered_ = false;
  hello_delay_ = config_.hello_delay;
  say_hello(now);
}

/// What stands in the way may pass: there are too many workers, a person releases the host, or the
/// list of keys was cut off for a moment.
void Conversation::come_again(const wire::Reject& reject, TimePoint now) {
  if (std::exchange(is_refused_, true)) return;  // The answer to a repeated Hello.
  if (now - refused_at_ >= config_.refusal_memory) refusal_delay_ = config_.refusal_delay;
  refused_at_ = now;
  is_registered_ = false;
  is_closed_out_ = reject.reason == wire::RejectReason::malformed || revocation_;
  const double jitter = 0.25 * fraction_of(mixed(session_.value + num_sent_));
  hello_due_at_ = now + times(1.0 + jitter, refusal_delay_);
  hello_delay_ = config_.hello_delay;
  refusal_delay_ = std::min(2 * refusal_delay_, config_.refusal_delay_max);
  if (!noted_refusals_.insert(reject.reason).second) return;
  const std::string how =
      fmt::format("(asks again every {} to {} s)", whole_seconds(config_.refusal_delay),
                  whole_seconds(config_.refusal_delay_max));
  note({.severity = wire::Severity::error,
        .kind = "refused",
        .fields = {wire::Field::reason(reject.text), wire::Field::remark(how)}});
}

void Conversation::say_hello(TimePoint now) {
  is_refused_ = false;
  send(hello_);
  const double jitter = 0.25 * fraction_of(mixed(session_.value + num_sent_));
  hello_due_at_ = now + times(1.0 + jitter, hello_delay_);
  hello_delay_ = std::min(2 * hello_delay_, config_.hello_delay_max);
}

/// What is not acknowledged counts against the credit, so that a coordinator that cannot store
/// results does not fill this worker's memory. What is set aside takes half of it at most, as long
/// as there is room, so that the worker goes on with other campaigns.
std::uint32_t Conversation::credit() const {
  if (leaving_) return 0;
  constexpr std::size_t credit_max = wire::runs_per_lease_max;
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
  wire::Heartbeat heartbeat{.num_runs_max = credit(),
                            .num_steps_done = execution_.num_steps_done(),
                            .held = grouped(std::move(held), wire::ranges_per_message_max),
                            .computing = {}};
  // Runs that are not listed here may be lent to others as well; runs not listed above are.
  const std::size_t room = wire::ranges_per_message_max - num_ranges(heartbeat.held);
  heartbeat.set_aside = grouped(std::move(aside), room);
  reported_batches_.clear();
  for (RunningBatch& batch : execution_.computing()) {
    reported_batches_.push_back(batch.number);
    heartbeat.computing.push_back(std::move(batch.progress));
  }
  send(std::move(heartbeat));
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
  send(wire::CampaignRequest{.campaign = campaign, .offset = wanted.incoming.num_bytes()});
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
  const auto read = read_definition(execution_, wanted.incoming.take());
  if (const auto* const refusal = std::get_if<std::string>(&read)) {
    wanted.request_due_at = now + config_.request_again_after;
    return note({.severity = wire::Severity::error,
                 .kind = "malformed_definition",
                 .fields = {{"campaign", fmt::format("{:016x}", campaign.value)},
                            wire::Field::remark(fmt::format("{:.400}", *refusal))}});
  }
  const auto& definition = std::get<std::shared_ptr<const Campaign>>(read);
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
std::vector<RunRange> Conversation::new_runs(const wire::RunLease& lease) {
  std::vector<RunIndex> runs;
  for (const RunIndex run : indices_of(std::array{lease.runs})) {
    const RunKey key{lease.campaign, run};
    const auto found = unfinished_.find(key);
    if (found != unfinished_.end()) {
      found->second = std::max(found->second, lease.attempt);
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
  note({.severity = wire::Severity::warning,
        .kind = "results_set_aside",
        .fields = {{"campaign", fmt::format("{:016x}", campaign.value)},
                   {"results", count},
                   wire::Field::remark("(not served now)")}});
}

std::vector<RunKey> Conversation::keep_finished(TimePoint now) {
  std::vector<RunKey> runs;
  for (FinishedRun& finished : execution_.take_finished()) {
    const RunKey key{finished.campaign, finished.computed.result.run};
    const auto found = unfinished_.find(key);
    PROOFMASS_EXPECT(found != unfinished_.end());
    unacknowledged_.add({.campaign = finished.campaign,
                         .attempt = found->second,
                         .computed = std::move(finished.computed)},
                        now);
    unfinished_.erase(found);
    runs.push_back(key);
  }
  return runs;
}

void Conversation::send_results(std::vector<wire::ResultBatch> batches) {
  for (wire::ResultBatch& batch : batches) send(std::move(batch));
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
  send(wire::GiveBack{reason, grouped(std::move(held), wire::ranges_per_message_max)});
}

}  // namespace proofmass::worker
