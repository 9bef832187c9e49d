#include "coordinator/net/service_snapshot.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator {

void FactoryReports::take(const proto::FactoryReport& report, const std::string& owner,
                          TimePoint now) {
  std::erase_if(known_, [&](const auto& entry) { return is_silent(entry.second, now); });
  const std::pair key(report.name(), owner);
  if (!known_.contains(key) && known_.size() >= wire::factories_max) {
    throw Error(
        fmt::format("factories = {} (must be at most {})", known_.size() + 1, wire::factories_max));
  }
  known_.insert_or_assign(key, Known{.report = report, .heard_at = now});
}

std::vector<proto::FactoryStatus> FactoryReports::current(TimePoint now) const {
  std::vector<proto::FactoryStatus> factories;
  for (const auto& [key, known] : known_) {
    if (is_silent(known, now)) continue;
    proto::FactoryStatus& factory = factories.emplace_back();
    *factory.mutable_report() = known.report;
    factory.set_owner(key.second);
    factory.set_silent_s(std::chrono::duration<double>(now - known.heard_at).count());
  }
  return factories;
}

bool FactoryReports::is_silent(const Known& known, TimePoint now) {
  return now - known.heard_at > 3 * std::chrono::seconds(known.report.interval_s());
}

std::string_view name_of(WorkerActivity activity) {
  constexpr std::array<std::string_view, worker_activities.size()> names{"computing", "idle",
                                                                         "silent", "quarantined"};
  return names.at(static_cast<std::size_t>(activity));
}

namespace {

WorkerActivity activity_of(const State& state, const Worker& worker, TimePoint now) {
  if (state.quarantined.contains(worker.host)) return WorkerActivity::quarantined;
  if (now - worker.heard_at > state.config.suspect_after) return WorkerActivity::silent;
  return worker.num_lent > 0 ? WorkerActivity::computing : WorkerActivity::idle;
}

/// Of the campaign that its cards were last lent runs of while they were idle.
double card_rate_of(const Worker& worker) {
  const auto latest = std::ranges::max_element(worker.card_work, {},
                                               [](const auto& of) { return of.second.since; });
  return latest == worker.card_work.end() ? 0.0 : latest->second.rate;
}

}  // namespace

RegisteredWorker record_of(const State& state, WorkerId id, const Worker& worker, TimePoint now) {
  const WorkerActivity activity = activity_of(state, worker, now);
  proto::WorkerStatus status;
  status.set_worker_id(id.value);
  status.set_name(worker.name);
  status.set_host(worker.host_name);
  status.set_process_id(worker.process_id);
  status.set_num_slots(worker.num_slots);
  status.set_num_lent(worker.num_lent);
  status.set_num_results(worker.num_results);
  status.set_silent_s(seconds(now - worker.heard_at));
  status.set_is_quarantined(activity == WorkerActivity::quarantined);
  status.set_cards(worker.cards);
  status.set_card_rate_hz(card_rate_of(worker));
  return {.status = std::move(status),
          .activity = activity,
          .registered_s = seconds(now - worker.registered_at)};
}

void take_workers(const State& state, TimePoint now, ServiceSnapshot& snapshot) {
  snapshot.workers.reserve(state.workers.size());
  for (const auto& [id, worker] : state.workers) {
    const RegisteredWorker& taken =
        snapshot.workers.emplace_back(record_of(state, id, worker, now));
    ++snapshot.num_workers_by_activity[static_cast<std::size_t>(taken.activity)];
  }
}

}  // namespace proofmass::coordinator
