#include "coordinator/cli/worker_processes.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/model_choice.hpp"

namespace proofmass::coordinator {
namespace {

constexpr int grace_ms = 3000;  // A worker looks at signals between two steps, some 20 ms apart.

constexpr int failures_in_a_row_max = 3;
constexpr int exit_usage = 2;  // Of a worker.
constexpr std::string_view first_name = "local-1";

std::uint64_t num_done(const Service& service) {
  std::uint64_t count = 0;
  for (const proto::CampaignStatus& campaign : service.campaigns()) count += campaign.num_done();
  return count;
}

}  // namespace

WorkerProcesses::WorkerProcesses(std::filesystem::path executable, std::string endpoint)
    : executable_(std::move(executable)),
      endpoint_(std::move(endpoint)),
      num_oom_kills_(wire::num_oom_kills()) {}

WorkerProcesses::~WorkerProcesses() {
  wait_until_ended(0);
  for (const Process& process : processes_) kill(process.process_id, SIGTERM);
  wait_until_ended(grace_ms);
  for (const Process& process : processes_) {
    kill(process.process_id, SIGKILL);
    (void)wire::wait_for_end(process.process_id);
  }
}

void WorkerProcesses::start(const std::string& name) {
  std::vector<std::string> arguments{executable_.string(),
                                     "--connect",
                                     endpoint_,
                                     "--name",
                                     name,
                                     "--threads",
                                     "1",
                                     "--gpu",
                                     name == first_name ? gpus_ : "none",
                                     "--parent",
                                     std::to_string(getpid())};
  wire::add_model_programs(arguments);
  const pid_t process_id = wire::start_program(
      {.arguments = std::move(arguments), .environment = wire::environment_without_settings()});
  processes_.push_back({.name = name, .process_id = process_id});
}

void WorkerProcesses::start_local(std::uint64_t count, const std::string& gpus) {
  gpus_ = gpus;
  for (std::uint64_t i = 1; i <= count; ++i) start(fmt::format("local-{}", i));
}

std::vector<WorkerProcesses::Exit> WorkerProcesses::take_exits() {
  std::vector<Exit> exits;
  std::erase_if(processes_, [&](const Process& process) {
    const std::optional<int> status = wire::status_if_ended(process.process_id);
    if (!status) return false;
    exits.push_back({.name = process.name,
                     .process_id = process.process_id,
                     .text = wire::end_text(*status),
                     .reason = reason_of(*status),
                     .is_refusal = WIFEXITED(*status) && WEXITSTATUS(*status) == exit_usage});
    return true;
  });
  return exits;
}

wire::LossReason WorkerProcesses::reason_of(int status) {
  const std::uint64_t num_before = std::exchange(num_oom_kills_, wire::num_oom_kills());
  return wire::reason_of_end(status, num_oom_kills_ > num_before);
}

void WorkerProcesses::wait_until_ended(int milliseconds_max) {
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::milliseconds(milliseconds_max);
  while (true) {
    (void)take_exits();
    if (processes_.empty() || std::chrono::steady_clock::now() >= deadline) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

LocalWorkers::LocalWorkers(Service& service, ProgressDisplay& display, WorkerProcesses& processes)
    : service_(service), display_(display), processes_(processes), host_(wire::host_name()) {}

void LocalWorkers::replace_dead() {
  for (const WorkerProcesses::Exit& exit : processes_.take_exits()) replace(exit);
  const State& state = service_.state();
  for (const auto& [id, campaign] : state.campaigns) {
    if (crashes_everywhere(state, campaign)) {
      throw Error(
          "the model crashes again and again without a finished run; see what is said above");
    }
    // Each worker starts the model's program itself, and those that replace them would.
    if (lacks_workers(state, campaign) && state.workers.size() >= processes_.count()) {
      throw Error(
          fmt::format("no worker has the model {}: its program says another version, or crashes, "
                      "where a worker starts it",
                      campaign.model.version));
    }
  }
}

void LocalWorkers::replace(const WorkerProcesses::Exit& exit) {
  const auto worker = service_.worker_of(static_cast<std::uint64_t>(exit.process_id));
  const std::string runs = worker ? runs_held_text(service_.state(), *worker) : "none";
  if (worker) service_.worker_ended(*worker, exit.reason);
  check(exit, runs);
  display_.note(fmt::format("worker {} (pid {}) ended: {}; it held runs {}; starting another",
                            exit.name, exit.process_id, exit.text, runs),
                Tone::bad);
  processes_.start(exit.name);
}

void LocalWorkers::check(const WorkerProcesses::Exit& exit, const std::string& runs) {
  if (exit.is_refusal) throw Error(fmt::format("worker {} refused its options", exit.name));
  const std::uint64_t num_done_now = num_done(service_);
  num_failures_ = num_done_now > num_done_at_failure_ ? 1 : num_failures_ + 1;
  num_done_at_failure_ = num_done_now;
  // Runs are blamed for a crash, and given up in the end; nothing else accounts for the others.
  const bool is_blamed =
      exit.reason == LossReason::crashed || exit.reason == LossReason::out_of_memory;
  const bool is_accounted_for = is_blamed && runs != "none";
  const bool is_hopeless = !is_accounted_for && num_failures_ >= failures_in_a_row_max;
  if (!is_hopeless && !is_quarantined(service_.state(), host_)) return;
  throw Error(
      fmt::format("{} workers in a row ended without a finished run; the last, {}: {}, "
                  "holding runs {}",
                  num_failures_, exit.name, exit.text, runs));
}

}  // namespace proofmass::coordinator
