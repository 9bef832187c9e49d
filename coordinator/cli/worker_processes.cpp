#include "coordinator/cli/worker_processes.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <system_error>
#include <thread>
#include <utility>

#include "coordinator/query/child_process.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"

extern char** environ;

namespace proofmass::coordinator {
namespace {

constexpr int grace_ms = 3000;  // A worker looks at signals between two orbits, some 20 ms apart.

/// Starts a program that can be ended with these signals, also if they are blocked here.
/// @return An error number, or 0.
int spawn(const std::filesystem::path& program, char* const* arguments, pid_t& process_id) {
  sigset_t mask;
  pthread_sigmask(SIG_SETMASK, nullptr, &mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigdelset(&mask, signal);
  posix_spawnattr_t attributes;
  if (const int error = posix_spawnattr_init(&attributes); error != 0) return error;
  posix_spawnattr_setsigmask(&attributes, &mask);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  const int error =
      posix_spawn(&process_id, program.c_str(), nullptr, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  return error;
}

constexpr int failures_in_a_row_max = 3;

std::uint64_t num_done(const Service& service) {
  std::uint64_t count = 0;
  for (const wire::CampaignStatus& campaign : service.campaigns()) count += campaign.num_done;
  return count;
}

}  // namespace

std::filesystem::path worker_executable() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path worker = self.parent_path() / "proofmass-worker";
  if (error || access(worker.c_str(), X_OK) != 0) {
    throw Error(fmt::format("worker program = {} (must be beside proofmass)", worker.string()));
  }
  return worker;
}

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
    waitpid(process.process_id, nullptr, 0);
  }
}

void WorkerProcesses::start(const std::string& name) {
  std::vector<std::string> arguments{
      executable_.string(),    "--connect", endpoint_, "--name", name, "--threads", "1", "--parent",
      std::to_string(getpid())};
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  pid_t process_id = 0;
  const int error = spawn(executable_, argv.data(), process_id);
  if (error != 0) {
    throw Error(fmt::format("worker program = {} ({})", executable_.string(), strerror(error)));
  }
  processes_.push_back({.name = name, .process_id = process_id});
}

std::vector<WorkerProcesses::Exit> WorkerProcesses::take_exits() {
  std::vector<Exit> exits;
  std::erase_if(processes_, [&](const Process& process) {
    int status = 0;
    if (waitpid(process.process_id, &status, WNOHANG) != process.process_id) return false;
    exits.push_back({.name = process.name,
                     .process_id = process.process_id,
                     .text = end_text(status),
                     .reason = reason_of(status)});
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
  const bool is_blamed =
      exit.reason == LossReason::crashed || exit.reason == LossReason::out_of_memory;
  const bool is_accounted_for = is_blamed && runs != "none";
  const bool is_hopeless = !is_accounted_for && num_failures_ >= failures_in_a_row_max;
  if (!is_hopeless && !service_.is_quarantined(host_)) return;
  throw Error(
      fmt::format("{} workers in a row ended without a finished run; the last, {}: {}, "
                  "holding runs {}",
                  num_failures_, exit.name, exit.text, runs));
}

}  // namespace proofmass::coordinator
