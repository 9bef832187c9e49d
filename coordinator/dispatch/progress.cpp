#include <algorithm>
#include <utility>

#include "coordinator/dispatch/workers.hpp"

namespace proofmass::coordinator::detail {
namespace {

double seconds(Duration duration) { return std::chrono::duration<double>(duration).count(); }

bool is_same(const wire::ComputedBatch& a, const wire::ComputedBatch& b) {
  return a.campaign == b.campaign && a.ranges == b.ranges;
}

void add_orbit_time(State& state, const Progress& before, const wire::ComputedBatch& batch,
                    TimePoint now) {
  const auto campaign = state.campaigns.find(batch.campaign);
  if (campaign == state.campaigns.end()) return;
  constexpr double weight = 0.2;  // Of the newest: the mean spans about the last ten.
  const double time_s = seconds(now - before.advanced_at) /
                        static_cast<double>(batch.num_orbits_done - before.batch.num_orbits_done);
  double& mean_s = campaign->second.orbit_time_s;
  mean_s = mean_s > 0.0 ? mean_s + weight * (time_s - mean_s) : time_s;
}

/// How long a batch may take for an orbit. Before anything is known, as if an orbit usually took a
/// tenth of what is waited at least; a run takes longer than any of its orbits.
Duration patience(const State& state, CampaignId id) {
  const DispatchConfig& config = state.config;
  double orbit_time_s = 0.1 * seconds(config.hung_after_min);
  const auto campaign = state.campaigns.find(id);
  if (campaign != state.campaigns.end()) {
    if (campaign->second.run_time_s > 0.0) orbit_time_s = campaign->second.run_time_s;
    if (campaign->second.orbit_time_s > 0.0) orbit_time_s = campaign->second.orbit_time_s;
  }
  constexpr double patience_s_max = 1e6;  // A worker may claim any time.
  const double patience_s = std::min(patience_s_max, config.hung_after_orbits * orbit_time_s);
  return std::max(config.hung_after_min,
                  std::chrono::duration_cast<Duration>(std::chrono::duration<double>(patience_s)));
}

}  // namespace

void note_progress(State& state, Worker& worker, const wire::Heartbeat& heartbeat, TimePoint now) {
  // After a silence the process, or the machine, may have slept: nothing is held against it.
  const bool was_silent = now - worker.heartbeat_at >= state.config.suspect_after;
  worker.heartbeat_at = now;
  worker.num_orbits_done = heartbeat.num_orbits_done;
  std::vector<Progress> computing;
  computing.reserve(heartbeat.computing.size());
  for (const wire::ComputedBatch& batch : heartbeat.computing) {
    TimePoint advanced_at = now;
    const auto before =
        std::find_if(worker.computing.begin(), worker.computing.end(),
                     [&](const Progress& progress) { return is_same(progress.batch, batch); });
    if (before != worker.computing.end() && !was_silent) {
      if (batch.num_orbits_done > before->batch.num_orbits_done) {
        add_orbit_time(state, *before, batch, now);
      } else {
        advanced_at = before->advanced_at;
      }
    }
    computing.push_back({.batch = batch, .advanced_at = advanced_at});
  }
  worker.computing = std::move(computing);
}

const wire::ComputedBatch* hung_batch(const State& state, const Worker& worker, TimePoint now) {
  // Of a worker that is not heard, nothing is known.
  if (now - worker.heard_at >= state.config.suspect_after) return nullptr;
  for (const Progress& progress : worker.computing) {
    if (now - progress.advanced_at >= patience(state, progress.batch.campaign)) {
      return &progress.batch;
    }
  }
  return nullptr;
}

}  // namespace proofmass::coordinator::detail
