#include "worker/supervision/restart_policy.hpp"

#include <algorithm>

namespace proofmass::worker {

std::optional<RestartConfig::Duration> RestartPolicy::on_crash(
    std::chrono::steady_clock::time_point now) {
  while (!crashes_.empty() && now - crashes_.front() > config_.window) crashes_.pop_front();
  crashes_.push_back(now);
  if (crashes_.size() >= config_.num_crashes_max) return std::nullopt;
  RestartConfig::Duration delay = config_.delay;
  for (std::size_t i = 1; i < crashes_.size() && delay < config_.delay_max; ++i) delay *= 2;
  return std::min(delay, config_.delay_max);
}

}  // namespace proofmass::worker
