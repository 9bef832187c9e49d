#include "worker/net/conversation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

#include "core/error.hpp"
#include "worker/execution/run_ranges.hpp"
#include "worker/net/held_runs.hpp"

namespace proofmass::worker {
namespace {

/// The mixing of SplitMix64: a number without visible relation to its argument, in [0, 1).
double fraction_from(std::uint64_t number) {
  number += 0x9e3779b97f4a7c15U;
  number = (number ^ (number >> 30)) * 0xbf58476d1ce4e5b9U;
  number = (number ^ (number >> 27)) * 0x94d049bb133111ebU;
  number ^= number >> 31;
  return static_cast<double>(number >> 11) * 0x1.0p-53;
}

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

}  // namespace

Conversation::Conversation(wire::SessionId session, wire::Hello hello, Execution& execution,
                           Send send, TimePoint now, const ConversationConfig& config)
    : session_(session),
      hello_(std::move(hello)),
      execution_(execution),
      send_(std::move(send)),
      config_(config),
      heard_at_(now) {
  PROOFMASS_EXPECT(session.value != 0);
  register_again(now);
}

void Conversation::restore(std::vector<KeptResult> results) {
  for (KeptResult& result : results) {
    const RunKey key{result.campaign, result.computed.result.run};
    unacknowledged_[key] = {.attempt = result.attempt,
                            .computed = result.computed,
                            .due_at = TimePoint::min(),
                            .resend_after = config_.resend_after};
  }
}

// What arrives.

void Conversation::on_packet(const wire::Packet& packet, TimePoint now) {
  if (ending_ || packet.header.session != session_) return;
  heard_at_ = now;
  const bool is_about_registration = std::holds_alternative<wire::Welcome>(packet.message) ||
                                     std::holds_alternative<wire::Reject>(packet.message);
  // What another coordinator process has said before it ended means nothing to the present one.
  if (!is_about_registration && packet.header.epoch != epoch_) return;
  std::visit([&](const auto& content) { handle(content, packet.header, now); }, packet.message);
}

void Conversation::handle(const wire::Welcome& welcome, const wire::Header& header, TimePoint now) {
  if (is_registered_) return;  // The answer to a repeated Hello.
  is_registered_ = true;
  epoch_ = header.epoch;
  heartbeat_interval_ = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(welcome.heartbeat_interval_s));
  send_heartbeat(now);
  repeat_results(now);
}

void Conversation::handle(const wire::Reject& reject, const wire::Header&, TimePoint now) {
  if (reject.reason != wire::RejectReason::not_registered) {
    return end(Ending::Kind::failed, "refused by the coordinator: " + reject.text);
  }
  if (is_registered_) register_again(now);  // Otherwise a Hello is under way.
}

void Conversation::handle(const wire::DefinitionPart& part, const wire::Header&, TimePoint now) {
  using Progress = wire::IncomingDefinition::Progress;
  const auto wanted = wanted_.find(part.campaign);
  if (wanted == wanted_.end()) return;
  const Progress progress = wanted->second.incoming.add(part);
  if (progress == Progress::advanced) return request(part.campaign, now);
  if (progress == Progress::complete) define(part.campaign, now);
}

void Conversation::handle(const wire::Forget& forget, const wire::Header&, TimePoint) {
  const auto is_of_it = [&](const auto& entry) { return entry.first.first == forget.campaign; };
  std::erase_if(unfinished_, is_of_it);
  std::erase_if(unacknowledged_, is_of_it);
  wanted_.erase(forget.campaign);
  table_widths_.erase(forget.campaign);
  execution_.forget(forget.campaign);
  leave_if_done();
}

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
    wire::RunLease part{lease.campaign, runs, lease.attempt, lease.is_alone, {}};
    part.table_values = values_of(lease, runs, width);
    execution_.submit(std::move(part));
    for (const RunIndex run : indices_of(std::array{runs}))
      unfinished_[{lease.campaign, run}] = lease.attempt;
  }
  const bool is_wanted = wanted_.contains(lease.campaign);
  if (!execution_.is_defined(lease.campaign) && !is_wanted) request(lease.campaign, now);
}

void Conversation::handle(const wire::Retract& retract, const wire::Header&, TimePoint) {
  give_back(wire::LossReason::retracted, retract.campaign,
            execution_.drop_waiting(retract.campaign, retract.ranges));
}

void Conversation::handle(const wire::ResultAck& ack, const wire::Header&, TimePoint) {
  for (const RunIndex run : ack.runs) unacknowledged_.erase({ack.campaign, run});
  leave_if_done();
}

void Conversation::handle(const wire::Drain&, const wire::Header&, TimePoint now) {
  if (!leaving_) begin_to_leave({.reason = wire::LossReason::drained, .deadline = {}}, now);
}

void Conversation::handle(const wire::Stop&, const wire::Header&, TimePoint) {
  execution_.abandon();
  end(Ending::Kind::done, "told to stop");
}

// What happens here.

void Conversation::on_connected(TimePoint now) {
  if (ending_) return;
  refusal_.clear();
  if (!is_registered_) return register_again(now);
  send_heartbeat(now);
  repeat_results(now);
}

void Conversation::on_refused(const std::string& reason) { refusal_ = reason; }

void Conversation::on_progress(TimePoint now) {
  if (ending_) return;
  const std::vector<RunKey> runs = keep_finished(now);
  if (const auto failure = execution_.failure()) {
    if (is_registered_) send(wire::Bye{wire::LossReason::failed});
    return end(Ending::Kind::failed, *failure);
  }
  if (is_registered_) send_results(runs, now);
  leave_if_done();
}

void Conversation::on_tick(TimePoint now) {
  if (ending_) return;
  if (now - heard_at_ >= config_.give_up_after) {
    return end(Ending::Kind::failed,
               fmt::format("coordinator = silent for {} s ({})", whole_seconds(now - heard_at_),
                           refusal_.empty() ? "is it running?" : refusal_));
  }
  watch_time(now);
  if (ending_) return;
  if (!is_registered_) {
    if (now >= hello_due_at_) say_hello(now);
    return;
  }
  request_definitions(now);
  send_due_results(now);
  const Duration since_heartbeat = now - heartbeat_at_;
  const bool has_news = since_heartbeat >= config_.news_interval && computes_other_batches();
  if (has_news || since_heartbeat >= heartbeat_interval_) send_heartbeat(now);
}

std::vector<KeptResult> Conversation::unacknowledged() const {
  std::vector<KeptResult> results;
  for (const auto& [key, sent] : unacknowledged_) {
    results.push_back({key.first, sent.attempt, sent.computed});
  }
  return results;
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

void Conversation::say_hello(TimePoint now) {
  send(hello_);
  const double jitter = 0.25 * fraction_from(session_.value + num_sent_);
  hello_due_at_ = now + times(1.0 + jitter, hello_delay_);
  hello_delay_ = std::min(2 * hello_delay_, config_.hello_delay_max);
}

/// What is not acknowledged counts against the credit, so that a coordinator that cannot store
/// results does not fill this worker's memory.
std::uint32_t Conversation::credit() const {
  if (leaving_) return 0;
  const std::size_t kept = std::min<std::size_t>(unacknowledged_.size(), wire::runs_per_lease_max);
  return static_cast<std::uint32_t>(wire::runs_per_lease_max - kept);
}

void Conversation::send_heartbeat(TimePoint now) {
  heartbeat_at_ = now;
  std::vector<HeldRun> held;
  held.reserve(unfinished_.size() + unacknowledged_.size());
  for (const auto& [key, attempt] : unfinished_) held.push_back({key.first, attempt, key.second});
  for (const auto& [key, result] : unacknowledged_) {
    held.push_back({key.first, result.attempt, key.second});
  }
  wire::Heartbeat heartbeat{.num_runs_max = credit(),
                            .num_orbits_done = execution_.num_orbits_done(),
                            .held = grouped(std::move(held), wire::ranges_per_message_max),
                            .computing = {}};
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
  const auto taken = wanted.incoming.take();
  if (std::holds_alternative<wire::DecodeError>(taken)) {
    wanted.request_due_at = now + config_.request_again_after;
    return;
  }
  const auto& definition = std::get<std::shared_ptr<const Campaign>>(taken);
  wanted_.erase(campaign);
  if (agrees_on_table(campaign, table_elements(definition->dispersions).size())) {
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

// Results.

std::vector<Conversation::RunKey> Conversation::keep_finished(TimePoint now) {
  std::vector<RunKey> runs;
  for (FinishedRun& finished : execution_.take_finished()) {
    const RunKey key{finished.campaign, finished.computed.result.run};
    const auto found = unfinished_.find(key);
    PROOFMASS_EXPECT(found != unfinished_.end());
    unacknowledged_[key] = {.attempt = found->second,
                            .computed = finished.computed,
                            .due_at = now,
                            .resend_after = config_.resend_after};
    unfinished_.erase(found);
    runs.push_back(key);
  }
  return runs;
}

void Conversation::repeat_results(TimePoint now) {
  for (auto& [key, result] : unacknowledged_) {
    result.due_at = now;
    result.resend_after = config_.resend_after;
  }
  send_due_results(now);
}

/// As many as one message may have; the next tick has the others.
void Conversation::send_due_results(TimePoint now) {
  std::vector<RunKey> runs;
  for (const auto& [key, result] : unacknowledged_) {
    if (runs.size() == wire::runs_per_lease_max) break;
    if (result.due_at <= now) runs.push_back(key);
  }
  send_results(runs, now);
}

/// @pre All of them are kept.
void Conversation::send_results(std::span<const RunKey> runs, TimePoint now) {
  std::map<std::pair<wire::CampaignId, wire::Attempt>, wire::ResultBatch> batches;
  for (const RunKey& run : runs) {
    SentResult& result = unacknowledged_.at(run);
    wire::ResultBatch& batch = batches[{run.first, result.attempt}];
    batch.campaign = run.first;
    batch.attempt = result.attempt;
    batch.results.push_back(result.computed);
    result.due_at = now + result.resend_after;
    result.resend_after = std::min(2 * result.resend_after, config_.resend_after_max);
    if (batch.results.size() == wire::runs_per_lease_max) {
      send(std::exchange(batch, {}));
      batches.erase({run.first, result.attempt});
    }
  }
  for (auto& [key, batch] : batches) send(std::move(batch));
}

}  // namespace proofmass::worker
