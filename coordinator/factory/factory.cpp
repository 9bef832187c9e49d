#include "coordinator/factory/factory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace proofmass::coordinator {
namespace {

using std::chrono::minutes;
using wire::Field;

constexpr int failed_submissions_max = 10;
constexpr int failed_starts_max = 3;
constexpr std::array<minutes, 4> waits{minutes(1), minutes(15), minutes(30), minutes(60)};

/// For the worker to start and to register, with modules loaded and containers fetched.
constexpr minutes start_wait{5};
/// Queues may show an allocation late, or leave it out for once.
constexpr minutes absence_wait{1};

std::string worker_name(const FactoryConfig& config, const std::string& id) {
  return config.name + "-" + id;
}

void count_failed_start(FactoryState& state, const FactoryConfig& config, const std::string& id,
                        std::string reason, const wire::Log& log) {
  if (!config.workers_log.empty()) reason += fmt::format(" (its log: {})", config.workers_log);
  ++state.num_failed_starts;
  state.failure = fmt::format("allocation {}: {}", id, reason);
  log(wire::Event::warning("worker_start_failed", {{"allocation", id}, Field::reason(reason)}));
}

bool is_coming(const FactoryState::Known& known) {
  return !known.has_registered && !known.is_cancelled;
}

std::uint64_t num_coming(const FactoryState& state) {
  return static_cast<std::uint64_t>(std::ranges::count_if(
      state.allocations, [](const auto& entry) { return is_coming(entry.second); }));
}

/// Takes up which allocations run and which workers have registered.
void look_at_allocations(FactoryState& state, const FactoryConfig& config, const FactoryView& view,
                         FactoryTime now) {
  for (const Allocation& allocation : view.allocations) {
    FactoryState::Known& known = state.allocations[allocation.id];
    known.seen = now;
    if (allocation.is_running && !known.running_since) known.running_since = now;
    if (!known.has_registered && view.workers.contains(worker_name(config, allocation.id))) {
      known.has_registered = true;
      if (!reason_to_pause(state)) state.num_failed_starts = 0;
    }
  }
}

/// @return Allocations that run and whose worker does not come.
std::vector<std::string> give_up_stuck(FactoryState& state, const FactoryConfig& config,
                                       FactoryTime now, const wire::Log& log) {
  std::vector<std::string> stuck;
  for (auto& [id, known] : state.allocations) {
    if (!is_coming(known) || !known.running_since || now - *known.running_since <= start_wait) {
      continue;
    }
    known.is_cancelled = true;
    stuck.push_back(id);
    count_failed_start(state, config, id, "its worker did not register within 5 minutes", log);
  }
  return stuck;
}

void forget_ended(FactoryState& state, const FactoryConfig& config, FactoryTime now,
                  const wire::Log& log) {
  std::erase_if(state.allocations, [&](const auto& entry) {
    const auto& [id, known] = entry;
    if (now - known.seen <= absence_wait) return false;
    if (is_coming(known)) {
      count_failed_start(state, config, id, "it ended before its worker registered", log);
    }
    return true;
  });
}

/// Cancels allocations that still wait for a node, the newest first; a running one is left to its
/// worker, which ends when it finds no work.
void cancel_waiting(FactoryState& state, const FactoryView& view, std::uint64_t count,
                    FactoryActions& actions) {
  for (std::size_t i = view.allocations.size(); i > 0 && count > 0; --i) {
    const Allocation& allocation = view.allocations[i - 1];
    FactoryState::Known& known = state.allocations[allocation.id];
    if (allocation.is_running || !is_coming(known)) continue;
    known.is_cancelled = true;
    actions.cancelled.push_back(allocation.id);
    --count;
  }
}

}  // namespace

std::uint64_t wanted_workers(const FactoryConfig& config, const FactoryView& view,
                             double rate_per_worker_hz) {
  if (view.num_open_runs == 0) return 0;
  const std::uint64_t least = std::max<std::uint64_t>(config.workers_min, 1);
  if (!(rate_per_worker_hz > 0.0)) {
    return std::clamp<std::uint64_t>(view.workers.size(), least, config.workers_max);
  }
  const double busy_s =
      config.utilisation_min * static_cast<double>(config.walltime / std::chrono::seconds(1));
  const double num_worth = static_cast<double>(view.num_open_runs) / (rate_per_worker_hz * busy_s);
  const double limited = std::min(num_worth, static_cast<double>(config.workers_max));
  return std::max(least, static_cast<std::uint64_t>(limited));
}

FactoryActions on_view(FactoryState& state, const FactoryConfig& config, const FactoryView& view,
                       FactoryTime now, const wire::Log& log) {
  look_at_allocations(state, config, view, now);
  FactoryActions actions;
  actions.cancelled = give_up_stuck(state, config, now, log);
  forget_ended(state, config, now, log);
  if (view.rate_hz > 0.0 && !view.workers.empty()) {
    state.rate_per_worker_hz = view.rate_hz / static_cast<double>(view.workers.size());
  }
  const std::uint64_t num_wanted = wanted_workers(config, view, state.rate_per_worker_hz);
  const std::uint64_t num_awaited = num_coming(state);
  const std::uint64_t num_expected = view.workers.size() + num_awaited;
  if (num_expected > num_wanted) {
    cancel_waiting(state, view, num_expected - num_wanted, actions);
    return actions;
  }
  if (now < state.next_submission || reason_to_pause(state)) return actions;
  const auto room = [](std::uint64_t max, std::uint64_t num) { return max - std::min(max, num); };
  actions.num_submissions = std::min({num_wanted - num_expected, room(config.backlog, num_awaited),
                                      room(config.workers_max, state.allocations.size())});
  return actions;
}

void on_submitted(FactoryState& state, const std::string& id, FactoryTime now) {
  state.num_failed_submissions = 0;
  state.allocations[id].seen = now;
}

void on_submission_failed(FactoryState& state, const std::string& reason, FactoryTime now,
                          const wire::Log& log) {
  const auto step = std::min<std::size_t>(static_cast<std::size_t>(state.num_failed_submissions),
                                          waits.size() - 1);
  ++state.num_failed_submissions;
  state.next_submission = now + waits[step];
  state.failure = "submission: " + reason;
  log(wire::Event::warning(
      "submission_failed",
      {{"retry_min", static_cast<std::uint64_t>(waits[step].count())}, Field::reason(reason)}));
}

std::optional<std::string> reason_to_pause(const FactoryState& state) {
  if (state.num_failed_submissions >= failed_submissions_max) {
    return fmt::format("{} submissions failed in a row; {}", state.num_failed_submissions,
                       state.failure);
  }
  if (state.num_failed_starts >= failed_starts_max) {
    return fmt::format("{} workers in a row did not start; {}", state.num_failed_starts,
                       state.failure);
  }
  return std::nullopt;
}

proto::FactoryReport report_of(const FactoryState& state, const FactoryConfig& config,
                               const FactoryView& view, FactoryTime now) {
  proto::FactoryReport report;
  report.set_name(config.name);
  report.set_batch_system(config.batch_system);
  report.set_interval_s(config.interval_s);
  report.set_phase(proto::FACTORY_PHASE_ACTIVE);
  report.set_num_wanted(wanted_workers(config, view, state.rate_per_worker_hz));
  report.set_num_registered(
      static_cast<std::uint64_t>(std::ranges::count_if(state.allocations, [&](const auto& entry) {
        return view.workers.contains(worker_name(config, entry.first));
      })));
  report.set_num_queued(num_coming(state));
  if (const auto reason = reason_to_pause(state)) {
    report.set_phase(proto::FACTORY_PHASE_PAUSED);
    report.set_reason(*reason);
  } else if (now < state.next_submission) {
    report.set_phase(proto::FACTORY_PHASE_WAITING);
    report.set_wait_s(std::chrono::duration<double>(state.next_submission - now).count());
    report.set_reason(state.failure);
  }
  return report;
}

}  // namespace proofmass::coordinator
