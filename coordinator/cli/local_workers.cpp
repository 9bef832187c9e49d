#include "coordinator/cli/local_workers.hpp"

#include <fmt/format.h>

#include "core/error.hpp"
#include "proto/link/host_name.hpp"

namespace proofmass::coordinator {
namespace {

constexpr int failures_in_a_row_max = 3;

std::uint64_t num_done(const Service& service) {
  std::uint64_t count = 0;
  for (const wire::CampaignStatus& campaign : service.campaigns()) count += campaign.num_done;
  return count;
}

}  // namespace

LocalWorkers::LocalWorkers(Service& service, ProgressDisplay& display)
    : service_(service),
      display_(display),
      processes_(worker_executable(), service.workers_endpoint()),
      host_(wire::host_name()) {}

void LocalWorkers::start(std::uint64_t num_workers) {
  for (std::uint64_t i = 1; i <= num_workers; ++i) processes_.start(fmt::format("local-{}", i));
}

void LocalWorkers::replace_dead() {
  for (const WorkerProcesses::Exit& exit : processes_.take_exits()) replace(exit);
}

void LocalWorkers::replace(const WorkerProcesses::Exit& exit) {
  const auto worker = service_.worker_of(static_cast<std::uint64_t>(exit.process_id));
  const std::string runs = worker ? service_.runs_held_text(*worker) : "none";
  if (worker) service_.worker_ended(*worker, exit.reason);
  check(exit, runs);
  display_.note(fmt::format("worker {} (pid {}) ended: {}; it held runs {}; starting another",
                            exit.name, exit.process_id, exit.text, runs));
  processes_.start(exit.name);
}

void LocalWorkers::check(const WorkerProcesses::Exit& exit, const std::string& runs) {
  const std::uint64_t num_done_now = num_done(service_);
  num_failures_ = num_done_now > num_done_at_failure_ ? 1 : num_failures_ + 1;
  num_done_at_failure_ = num_done_now;
  // Runs are blamed for a crash, and given up in the end; nothing else accounts for the others.
  const bool is_accounted_for = exit.reason != LossReason::failed && runs != "none";
  const bool is_hopeless = !is_accounted_for && num_failures_ >= failures_in_a_row_max;
  if (!is_hopeless && !service_.is_quarantined(host_)) return;
  throw Error(
      fmt::format("{} workers in a row ended without a finished run; the last, {}: {}, "
                  "holding runs {}",
                  num_failures_, exit.name, exit.text, runs));
}

}  // namespace proofmass::coordinator
