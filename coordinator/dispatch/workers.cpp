#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "coordinator/dispatch/detail.hpp"
#include "coordinator/dispatch/events.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

proto::Envelope drain_message() {
  proto::Envelope envelope;
  (void)envelope.mutable_drain();
  return envelope;
}

proto::Envelope stop_message() {
  proto::Envelope envelope;
  (void)envelope.mutable_stop();
  return envelope;
}

ModelIdentity identity_of(const proto::OtherModel& other) {
  return {.version = other.version(),
          .reference_digest = other.reference_digest(),
          .description_digest = other.description_digest()};
}

std::string difference(const ModelIdentity& model, const ModelIdentity& wanted) {
  if (model.description_digest != wanted.description_digest) {
    return fmt::format(
        "{} has another description than where its campaign began; a model that has changed needs "
        "another version",
        model.version);
  }
  return fmt::format(
      "reference_digest of {} = {:016x} (must be {:016x}, where its campaign began; a model that "
      "has changed needs another version, machines that differ need tolerate_digest = true)",
      model.version, model.reference_digest, wanted.reference_digest);
}

/// Why a worker's model is lent no runs: its program computes something else than it did where the
/// campaigns of this version began.
std::optional<std::string> refusal_of(State& state, const proto::OtherModel& other) {
  const ModelIdentity model = identity_of(other);
  std::optional<std::string> why;
  bool is_lent_some = false;
  for (const CampaignId id : state.served) {
    CampaignState& campaign = state.campaigns.at(id);
    if (campaign.model.version != model.version) continue;
    if (is_accepted(model, campaign)) {
      is_lent_some = true;
    } else {
      why = campaign.model_refusal = difference(model, campaign.model);
    }
  }
  return is_lent_some ? std::nullopt : why;
}

/// Why a worker that says Hello cannot be taken, as a Reject; nothing if it can.
std::optional<proto::Envelope> refusal(State& state, const HostId& host,
                                       const proto::Hello& hello) {
  const std::string_view own_version = built_in_model().version();
  if (hello.model_version() != own_version) {
    return wire::rejection(proto::REJECT_REASON_INCOMPATIBLE,
                           fmt::format("model_version = {} (must be {}, the coordinator's)",
                                       hello.model_version(), own_version));
  }
  if (hello.reference_digest() != state.config.reference_digest) {
    return wire::rejection(
        proto::REJECT_REASON_INCOMPATIBLE,
        fmt::format("reference_digest = {:016x} (must be {:016x}, the coordinator's)",
                    hello.reference_digest(), state.config.reference_digest));
  }
  std::string changed;
  int num_changed = 0;
  for (const proto::OtherModel& other : hello.other_models()) {
    const std::optional<std::string> why = refusal_of(state, other);
    if (!why) continue;
    changed = *why;
    ++num_changed;
  }
  // One that has others computes their runs.
  if (num_changed > 0 && num_changed == hello.other_models_size()) {
    return wire::rejection(proto::REJECT_REASON_INCOMPATIBLE, changed);
  }
  if (state.quarantined.contains(host)) {
    return wire::rejection(proto::REJECT_REASON_QUARANTINED,
                           fmt::format("host = {} (too much crashed there)", hello.host()));
  }
  if (state.workers.size() >= state.config.num_workers_max) {
    return wire::rejection(
        proto::REJECT_REASON_FULL,
        fmt::format("number of workers = {} (no more are served)", state.workers.size()));
  }
  return std::nullopt;
}

/// Forgets the address of this key that has been without workers for the longest, if there are too
/// many: a key that has many must not fill the memory, nor make those of others forgotten.
void limit_hosts(State& state, const std::string& key) {
  const auto first = state.hosts.lower_bound({.key = key, .address = ""});
  auto oldest = state.hosts.end();
  std::size_t count = 0;
  for (auto host = first; host != state.hosts.end() && host->first.key == key; ++host, ++count) {
    if (host->second.num_workers > 0) continue;
    if (oldest == state.hosts.end() || host->second.left_at < oldest->second.left_at) oldest = host;
  }
  if (count <= state.config.hosts_per_key_max || oldest == state.hosts.end()) return;
  state.quarantined.erase(oldest->first);
  state.hosts.erase(oldest);
}

void register_worker(State& state, WorkerId id, SessionId session, const HostId& host,
                     const proto::Hello& hello, TimePoint now, Outbox& outbox) {
  Worker& worker = state.workers[id];
  worker.session = session;
  worker.name = hello.worker_name();
  worker.host = host;
  worker.host_name = hello.host();
  worker.process_id = hello.process_id();
  worker.num_slots = hello.num_slots();
  worker.num_card_slots = hello.num_card_slots();
  worker.slots_per_thread = hello.slots_per_thread();
  worker.cards = hello.cards();
  worker.models.push_back(
      {.version = hello.model_version(), .reference_digest = hello.reference_digest()});
  for (const proto::OtherModel& other : hello.other_models()) {
    worker.models.push_back(identity_of(other));
  }
  state.absent.erase(session);
  worker.registered_at = now;
  worker.heard_at = now;
  worker.heartbeat_at = now;
  worker.retracted_at = now - state.config.heartbeat_interval;
  state.num_slots += worker.num_slots;
  state.num_slots_expected -=
      std::min<std::uint64_t>(state.num_slots_expected, num_processor_slots(worker));
  detail::set_eligible(state, worker, true);
  Host& known = state.hosts[host];
  if (known.name.empty()) known.name = hello.host();
  ++known.num_workers;
  limit_hosts(state, host.key);
  wire::Fields fields{{"worker", id.value},
                      {"name", worker.name},
                      {"host", worker.host_name},
                      {"pid", worker.process_id},
                      {"slots", worker.num_slots}};
  if (worker.num_card_slots > 0) {
    fields.emplace_back("card_slots", worker.num_card_slots);
    fields.emplace_back("cards", worker.cards);
  }
  for (const proto::OtherModel& other : hello.other_models()) {
    fields.emplace_back("model", other.version());
  }
  outbox.log(Event::info("worker_registered", std::move(fields)));
  for (const proto::OtherModel& other : hello.other_models()) {
    const std::optional<std::string> why = refusal_of(state, other);
    if (!why) continue;
    outbox.log(
        Event::warning("model_left_out",
                       {{"worker", id.value}, {"name", worker.name}, wire::Field::reason(*why)}));
  }
}

/// True if a Hello may be answered: there is an allowance of so many a second.
bool take_hello_allowance(State& state, TimePoint now) {
  const double passed_s = seconds(now - state.hello_allowance_at);
  state.hello_allowance_at = now;
  state.hello_allowance =
      std::min(state.config.hellos_per_s_max,
               state.hello_allowance + passed_s * state.config.hellos_per_s_max);
  if (state.hello_allowance < 1.0) return false;
  state.hello_allowance -= 1.0;
  return true;
}

/// The worker's process ended, or must end: logs it and forgets the worker. Blames runs if the
/// reason says that one of them may be the cause. The caller settles.
void part_with(State& state, WorkerId id, LossReason reason, Outbox& outbox) {
  const Worker& worker = state.workers.at(id);
  outbox.log(Event::warning("worker_gone", {{"worker", id.value},
                                            {"name", worker.name},
                                            {"reason", name_of(reason)},
                                            {"steps", worker.num_steps_done}}));
  const detail::RunsByCampaign blamed =
      is_blamed(reason) ? detail::blame_crash(state, id, outbox) : detail::RunsByCampaign();
  detail::remove_worker(state, id, reason, blamed, outbox);
}

/// A batch of the worker hangs: tells the worker to end, and parts with it.
void part_with_hung(State& state, WorkerId id, const Progress& batch, Outbox& outbox) {
  outbox.log(Event::warning("worker_gone", {{"worker", id.value},
                                            {"name", state.workers.at(id).name},
                                            {"reason", "hung"},
                                            {"runs", to_text(batch.runs)},
                                            {"steps", batch.num_steps_done}}),
             batch.campaign);
  outbox.send(id, stop_message());
  const detail::RunsByCampaign blamed = detail::blame_batch(state, id, batch, outbox);
  detail::remove_worker(state, id, LossReason::hung, blamed, outbox);
}

/// The process before this one crashed: that is sooner known than that it is silent. Nobody but the
/// same key on the same host may say so.
void note_former(State& state, const HostId& host, const proto::FormerSession& former,
                 Outbox& outbox) {
  const SessionId session{former.session()};
  state.awaited.erase(session);
  const auto found = std::ranges::find_if(
      state.workers, [&](const auto& item) { return item.second.session == session; });
  if (found != state.workers.end() && found->second.host == host) {
    part_with(state, found->first, wire::loss_reason(former.reason()), outbox);
  }
}

/// Ends the registration that has been silent for the longest if no more workers can be taken: its
/// process may be gone. If it is not, it registers again.
void make_room(State& state, TimePoint now, Outbox& outbox) {
  const auto silent = std::min_element(
      state.workers.begin(), state.workers.end(),
      [](const auto& a, const auto& b) { return a.second.heard_at < b.second.heard_at; });
  if (silent == state.workers.end()) return;
  if (now - silent->second.heard_at < state.config.suspect_after) return;
  part_with(state, silent->first, LossReason::silent, outbox);
}

/// Registered workers are answered again: the answer before may have been lost.
void welcome(State& state, WorkerId id, Outbox& outbox) {
  proto::Envelope envelope;
  envelope.mutable_welcome()->set_worker_id(id.value);
  envelope.mutable_welcome()->set_heartbeat_interval_s(seconds(state.config.heartbeat_interval));
  outbox.send(id, std::move(envelope));
  if (!state.is_lending) outbox.send(id, drain_message());
}

void end_quarantines(State& state, Outbox& outbox) {
  std::erase_if(state.quarantined, [&](const auto& item) {
    const bool is_over = state.ticked_at >= item.second;
    if (is_over) {
      outbox.log(Event::info("host_released", {{"host", state.hosts.at(item.first).name}}));
    }
    return is_over;
  });
}

/// Once all that should be attached have said what they hold, or had the time to, the others are
/// gone.
void end_absent(State& state, Outbox& outbox) {
  if (!state.awaited.empty()) return;
  for (const SessionId session : std::exchange(state.absent, {})) {
    outbox.write({}, WorkerEnded{.session = session, .reason = LossReason::silent});
  }
}

void send_to_all(const State& state, const proto::Envelope& message, Outbox& outbox) {
  for (const auto& [id, worker] : state.workers) outbox.send(id, message);
}

std::vector<wire::ComputedRun> results_of(const proto::ResultBatch& batch) {
  std::vector<wire::ComputedRun> results;
  results.reserve(static_cast<std::size_t>(batch.results_size()));
  for (const proto::ComputedRun& run : batch.results()) {
    results.push_back(wire::computed_run(run));
  }
  return results;
}

}  // namespace

namespace detail {

Worker* heard(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  const auto found = state.workers.find(id);
  if (found == state.workers.end()) {
    reject_unregistered(id, outbox);
    return nullptr;
  }
  found->second.heard_at = now;
  return &found->second;
}

}  // namespace detail

void reject_unregistered(WorkerId id, Outbox& outbox) {
  outbox.send(
      id, wire::rejection(proto::REJECT_REASON_NOT_REGISTERED, "this worker is not registered"));
}

void on_message(State& state, WorkerId id, const HostId& from, const proto::Envelope& message,
                TimePoint now, Outbox& outbox) {
  switch (message.from_worker_case()) {
    case proto::Envelope::kHello:
      return on_hello(state, id, {message.session()}, from, message.hello(), now, outbox);
    case proto::Envelope::kHeartbeat:
      return on_heartbeat(state, id, message.heartbeat(), message.sequence(), now, outbox);
    case proto::Envelope::kResultBatch:
      return on_results(state, id, {message.result_batch().campaign()},
                        {message.result_batch().attempt()}, results_of(message.result_batch()), now,
                        outbox);
    case proto::Envelope::kGiveBack:
      return on_give_back(state, id, message.give_back(), now, outbox);
    case proto::Envelope::kCampaignRequest:
      return on_campaign_request(state, id, {message.campaign_request().campaign()},
                                 message.campaign_request().offset(), now, outbox);
    case proto::Envelope::kBye:
      return on_bye(state, id, wire::loss_reason(message.bye().reason()), now, outbox);
    case proto::Envelope::FROM_WORKER_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

void on_hello(State& state, WorkerId id, SessionId session, const HostId& from,
              const proto::Hello& hello, TimePoint now, Outbox& outbox) {
  if (!take_hello_allowance(state, now)) return;
  if (state.is_stopped) return outbox.send(id, stop_message());
  if (hello.has_former()) note_former(state, from, hello.former(), outbox);
  const bool is_new = !state.workers.contains(id);
  auto reject = is_new ? refusal(state, from, hello) : std::nullopt;
  if (reject && reject->reject().reason() == proto::REJECT_REASON_FULL) {
    make_room(state, now, outbox);
    reject = refusal(state, from, hello);
  }
  if (reject) {
    state.awaited.erase(session);
    ++state.num_refusals;
    state.last_refusal = fmt::format("{}: {}", hello.worker_name(), reject->reject().text());
    state.refused_at = now;
    outbox.log(Event::warning(
        "worker_refused", {{"name", hello.worker_name()}, Field::reason(reject->reject().text())}));
    outbox.send(id, *std::move(reject));
  } else {
    if (is_new) register_worker(state, id, session, from, hello, now, outbox);
    state.workers.at(id).heard_at = now;
    welcome(state, id, outbox);
  }
  detail::settle(state, now, outbox);
}

bool on_release_host(State& state, const std::string& host, TimePoint now, Outbox& outbox) {
  const std::size_t num_released = std::erase_if(state.quarantined, [&](const auto& item) {
    Host& released = state.hosts.at(item.first);
    if (released.name != host && item.first.address != host) return false;
    released.num_crashes = 0;
    return true;
  });
  if (num_released == 0) return false;
  outbox.log(Event::info("host_released", {{"host", host}}));
  detail::lend_to_hungry(state, now, outbox);
  return true;
}

void on_campaign_request(State& state, WorkerId id, CampaignId campaign, std::uint64_t offset,
                         TimePoint now, Outbox& outbox) {
  if (detail::heard(state, id, now, outbox) == nullptr) return;
  const auto found = state.campaigns.find(campaign);
  if (found == state.campaigns.end() || found->second.phase == Phase::cancelled) {
    return detail::send_not_served(state, id, campaign, outbox);
  }
  outbox.send_definition(id, campaign, offset, found->second.definition);
}

void on_heartbeat(State& state, WorkerId id, const proto::Heartbeat& heartbeat,
                  std::uint64_t sequence, TimePoint now, Outbox& outbox) {
  Worker* const worker = detail::heard(state, id, now, outbox);
  if (worker == nullptr) return;
  proto::Envelope answer;
  (void)answer.mutable_heartbeat_ack();
  outbox.send(id, std::move(answer));
  if (sequence <= worker->heartbeat_sequence) return;
  worker->heartbeat_sequence = sequence;
  worker->num_runs_max = heartbeat.num_runs_max();
  detail::note_progress(state, *worker, heartbeat, now);
  if (state.is_stopped) return outbox.send(id, stop_message());
  if (!state.is_lending) outbox.send(id, drain_message());
  detail::reconcile(state, id, heartbeat, now, outbox);
  state.awaited.erase(worker->session);
  detail::lend(state, id, now, outbox);
  detail::settle(state, now, outbox);
}

void on_give_back(State& state, WorkerId id, const proto::GiveBack& give_back, TimePoint now,
                  Outbox& outbox) {
  Worker* const worker = detail::heard(state, id, now, outbox);
  if (worker == nullptr) return;
  const LossReason reason = wire::loss_reason(give_back.reason());
  for (const proto::HeldRuns& held : give_back.runs()) {
    const CampaignId campaign{held.campaign()};
    const RunSet runs(wire::ranges_of(held.ranges()));
    detail::RunsByCampaign blamed;
    if (is_blamed(reason)) blamed = detail::blame_simulation(state, id, campaign, runs, outbox);
    if (const auto found = worker->unleased.find(campaign); found != worker->unleased.end()) {
      found->second.remove(runs);
      if (found->second.empty()) worker->unleased.erase(found);
    }
    const std::set<LeaseId> leases = worker->leases;
    for (const LeaseId lease_id : leases) {
      const auto found = state.leases.find(lease_id);
      if (found == state.leases.end()) continue;  // It ended with one before it.
      const Lease& lease = found->second;
      if (lease.campaign != campaign || lease.known_as != Attempt{held.attempt()}) continue;
      const RunSet lost = lease.remaining.overlap(runs);
      if (!lost.empty()) detail::lose(state, lease_id, lost, reason, blamed[campaign], outbox);
    }
  }
  if (reason == LossReason::retracted) worker->num_retracts = 0;
  // Other workers come first: this one may give back again what it is lent.
  state.hungry.erase(id);
  detail::settle(state, now, outbox);
  detail::lend(state, id, now, outbox);
}

void on_bye(State& state, WorkerId id, LossReason reason, TimePoint now, Outbox& outbox) {
  const auto found = state.workers.find(id);
  if (found == state.workers.end()) return;
  outbox.log(Event::info(
      "worker_left",
      {{"worker", id.value}, {"name", found->second.name}, {"reason", name_of(reason)}}));
  detail::remove_worker(state, id, reason, {}, outbox);
  detail::settle(state, now, outbox);
}

void on_gone(State& state, WorkerId id, LossReason reason, TimePoint now, Outbox& outbox) {
  if (!state.workers.contains(id)) return;
  part_with(state, id, reason, outbox);
  detail::settle(state, now, outbox);
}

void on_tick(State& state, TimePoint now, Outbox& outbox) {
  state.ticked_at = now;
  end_quarantines(state, outbox);
  detail::give_up_untried(state, outbox);
  detail::pause_crashing_campaigns(state, outbox);
  if (now >= state.awaited_until) state.awaited.clear();
  end_absent(state, outbox);
  const Duration lost_after =
      state.is_behind ? state.config.lost_after_if_behind : state.config.lost_after;
  std::vector<WorkerId> silent;
  std::vector<std::pair<WorkerId, Progress>> hung;
  for (auto& [id, worker] : state.workers) {
    detail::set_eligible(state, worker, detail::may_be_lent(state, worker, now));
    if (now - worker.heard_at >= lost_after) {
      silent.push_back(id);
      continue;
    }
    const auto* const batch = state.is_behind ? nullptr : detail::hung_batch(state, worker, now);
    if (batch != nullptr) hung.emplace_back(id, *batch);
  }
  // All of them go before anything is lent again, or one would be lent what another lost.
  for (const WorkerId id : silent) part_with(state, id, LossReason::silent, outbox);
  for (const auto& [id, batch] : hung) part_with_hung(state, id, batch, outbox);
  detail::settle(state, now, outbox);
  detail::speculate(state, now, outbox);
}

void on_drain(State& state, Outbox& outbox) {
  state.is_lending = false;
  send_to_all(state, drain_message(), outbox);
}

void on_stop(State& state, Outbox& outbox) {
  state.is_lending = false;
  state.is_stopped = true;
  send_to_all(state, stop_message(), outbox);
}

void on_end(State& state, Outbox& outbox) {
  end_absent(state, outbox);
  for (const auto& [id, worker] : state.workers) {
    outbox.write({}, WorkerEnded{.session = worker.session, .reason = LossReason::drained});
  }
}

}  // namespace proofmass::coordinator
