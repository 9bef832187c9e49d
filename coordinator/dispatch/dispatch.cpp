#include "coordinator/dispatch/dispatch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "coordinator/dispatch/lending.hpp"
#include "core/error.hpp"
#include "core/simulation/run.hpp"

namespace proofmass::coordinator {
namespace {

double seconds(Duration duration) { return std::chrono::duration<double>(duration).count(); }

/// The worker of a message, marked as heard; null, and told so, if it is not registered.
Worker* heard(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  const auto found = state.workers.find(id);
  if (found == state.workers.end()) {
    outbox.send(id, wire::Reject{.reason = wire::RejectReason::not_registered,
                                 .text = "this worker is not registered"});
    return nullptr;
  }
  found->second.heard_at = now;
  return &found->second;
}

/// Why a worker that says Hello cannot be taken; empty if it can.
std::optional<wire::Reject> refusal(const State& state, const wire::Hello& hello) {
  if (hello.model_version != model_version) {
    return wire::Reject{.reason = wire::RejectReason::incompatible,
                        .text = fmt::format("model_version = {} (must be {}, the coordinator's)",
                                            hello.model_version, model_version)};
  }
  if (state.workers.size() >= state.config.num_workers_max) {
    return wire::Reject{
        .reason = wire::RejectReason::full,
        .text = fmt::format("number of workers = {} (no more are served)", state.workers.size())};
  }
  return std::nullopt;
}

void register_worker(State& state, WorkerId id, const wire::Hello& hello, TimePoint now,
                     Outbox& outbox) {
  Worker worker;
  worker.name = hello.worker_name;
  worker.host = hello.host;
  worker.process_id = hello.process_id;
  worker.num_slots = hello.num_slots;
  worker.heard_at = now;
  state.workers.emplace(id, std::move(worker));
  outbox.log(
      {.severity = Severity::info,
       .kind = "worker_registered",
       .text = fmt::format("worker={} name={} host={} pid={} slots={}", id.value, hello.worker_name,
                           hello.host, hello.process_id, hello.num_slots)});
}

Event gone_event(const State& state, WorkerId id, std::string_view reason) {
  const Worker& worker = state.workers.at(id);
  return {.severity = Severity::warning,
          .kind = "worker_gone",
          .text = fmt::format("worker={} name={} reason={} orbits={}", id.value, worker.name,
                              reason, worker.num_orbits_done)};
}

/// Forgets the worker; what it holds becomes pending.
void remove_worker(State& state, WorkerId id, Event event, Outbox& outbox) {
  outbox.log(std::move(event));
  detail::take_back_all(state, id, outbox);
  state.workers.erase(id);
}

void add_run_time(double compute_s, double& mean_s) {
  constexpr double weight = 0.2;  // Of the newest run: the mean spans about the last ten.
  mean_s = mean_s > 0.0 ? mean_s + weight * (compute_s - mean_s) : compute_s;
}

/// A result of an open run goes to the store; true if it is durable already.
bool take_result(State& state, WorkerId id, const wire::ResultBatch& batch,
                 const wire::ComputedRun& computed, Outbox& outbox) {
  const RunIndex run = computed.result.run;
  if (detail::close_run(state, run, batch.lease)) {
    state.delivered.emplace(run, std::vector<WorkerId>{id});
    if (!computed.result.has_estimate()) ++state.num_without_estimate;
    outbox.store({.worker = id, .attempt = batch.attempt, .computed = computed});
    return false;
  }
  ++state.num_duplicates;
  const auto waiting = state.delivered.find(run);
  if (waiting == state.delivered.end()) return true;
  if (std::find(waiting->second.begin(), waiting->second.end(), id) == waiting->second.end()) {
    waiting->second.push_back(id);
  }
  return false;
}

void send_to_all(const State& state, const wire::Message& message, Outbox& outbox) {
  for (const auto& [id, worker] : state.workers) outbox.send(id, message);
}

void send_acks(const State& state, std::map<WorkerId, std::vector<RunIndex>> runs_by_worker,
               Outbox& outbox) {
  for (auto& [id, runs] : runs_by_worker) {
    if (!state.workers.contains(id)) continue;
    for (std::size_t first = 0; first < runs.size(); first += wire::runs_per_lease_max) {
      const auto begin = runs.begin() + static_cast<std::ptrdiff_t>(first);
      const auto count = std::min<std::size_t>(wire::runs_per_lease_max, runs.size() - first);
      outbox.send(id, wire::ResultAck{.runs = {begin, begin + static_cast<std::ptrdiff_t>(count)}});
    }
  }
}

}  // namespace

void on_hello(State& state, WorkerId id, const wire::Hello& hello, TimePoint now, Outbox& outbox) {
  if (!state.is_lending) return outbox.send(id, wire::Stop{});
  if (!state.workers.contains(id)) {
    if (auto reject = refusal(state, hello)) {
      outbox.log({.severity = Severity::warning,
                  .kind = "worker_refused",
                  .text = fmt::format("name={} {}", hello.worker_name, reject->text)});
      return outbox.send(id, *std::move(reject));
    }
    register_worker(state, id, hello, now, outbox);
  }
  state.workers.at(id).heard_at = now;
  outbox.send(id, wire::Welcome{.worker = id,
                                .heartbeat_interval_s = seconds(state.config.heartbeat_interval),
                                .campaign = state.campaign});
}

void on_credit(State& state, WorkerId id, const wire::Credit& credit, TimePoint now,
               Outbox& outbox) {
  Worker* const worker = heard(state, id, now, outbox);
  if (worker == nullptr) return;
  worker->num_runs_max = credit.num_runs_max;
  detail::lend(state, id, now, outbox);
}

void on_results(State& state, WorkerId id, const wire::ResultBatch& batch, TimePoint now,
                Outbox& outbox) {
  Worker* const worker = heard(state, id, now, outbox);
  if (worker == nullptr) return;
  const auto is_foreign = [&](const wire::ComputedRun& computed) {
    return computed.result.run.value >= state.campaign->num_runs;
  };
  if (std::any_of(batch.results.begin(), batch.results.end(), is_foreign)) {
    outbox.send(id, wire::Reject{.reason = wire::RejectReason::malformed,
                                 .text = "run = beyond the campaign (must be below num_runs)"});
    return on_gone(state, id, "foreign_run", now, outbox);
  }
  std::map<WorkerId, std::vector<RunIndex>> durable;
  for (const wire::ComputedRun& computed : batch.results) {
    add_run_time(computed.compute_s, worker->run_time_s);
    add_run_time(computed.compute_s, state.run_time_s);
    if (take_result(state, id, batch, computed, outbox)) {
      durable[id].push_back(computed.result.run);
    }
  }
  send_acks(state, std::move(durable), outbox);
  detail::lend(state, id, now, outbox);
}

void on_committed(State& state, std::span<const RunIndex> runs, Outbox& outbox) {
  std::map<WorkerId, std::vector<RunIndex>> acknowledged;
  for (const RunIndex run : runs) {
    const auto waiting = state.delivered.find(run);
    PROOFMASS_EXPECT(waiting != state.delivered.end());
    for (const WorkerId id : waiting->second) acknowledged[id].push_back(run);
    state.delivered.erase(waiting);
    state.committed.add({.first = run, .count = 1});
  }
  state.num_committed_here += runs.size();
  send_acks(state, std::move(acknowledged), outbox);
  if (!is_finished(state) || !state.is_lending) return;
  outbox.log({.severity = Severity::info,
              .kind = "campaign_finished",
              .text = fmt::format("runs={} duplicates={}", state.campaign->num_runs,
                                  state.num_duplicates)});
  on_stop(state, outbox);
}

void on_heartbeat(State& state, WorkerId id, const wire::Heartbeat& heartbeat, TimePoint now,
                  Outbox& outbox) {
  Worker* const worker = heard(state, id, now, outbox);
  if (worker == nullptr) return;
  worker->num_orbits_done = heartbeat.num_orbits_done;
  outbox.send(id, wire::HeartbeatAck{});
  bool any_back = false;
  for (auto lease = state.leases.begin(); lease != state.leases.end();) {
    const auto current = lease++;
    const auto& [lease_id, content] = *current;
    if (content.worker != id || now - content.lent_at < state.config.lease_arrival_max) continue;
    const auto& held = heartbeat.leases;
    if (std::find(held.begin(), held.end(), lease_id) != held.end()) continue;
    detail::take_back(state, current, outbox);
    any_back = true;
  }
  if (any_back) detail::lend_to_all(state, now, outbox);
}

void on_bye(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  if (!state.workers.contains(id)) return;
  remove_worker(state, id,
                {.severity = Severity::info,
                 .kind = "worker_left",
                 .text = fmt::format("worker={}", id.value)},
                outbox);
  detail::lend_to_all(state, now, outbox);
}

void on_gone(State& state, WorkerId id, const std::string& reason, TimePoint now, Outbox& outbox) {
  if (!state.workers.contains(id)) return;
  remove_worker(state, id, gone_event(state, id, reason), outbox);
  detail::lend_to_all(state, now, outbox);
}

void on_tick(State& state, TimePoint now, Outbox& outbox) {
  std::vector<WorkerId> silent;
  for (const auto& [id, worker] : state.workers) {
    if (now - worker.heard_at >= state.config.lost_after) silent.push_back(id);
  }
  // All of them go before anything is lent again, or one would be lent what another lost.
  for (const WorkerId id : silent)
    remove_worker(state, id, gone_event(state, id, "silent"), outbox);
  if (!silent.empty()) detail::lend_to_all(state, now, outbox);
}

void on_drain(State& state, Outbox& outbox) {
  state.is_lending = false;
  send_to_all(state, wire::Drain{}, outbox);
}

void on_stop(State& state, Outbox& outbox) {
  state.is_lending = false;
  send_to_all(state, wire::Stop{}, outbox);
}

}  // namespace proofmass::coordinator
