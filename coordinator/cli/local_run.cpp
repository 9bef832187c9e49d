#include "coordinator/cli/local_run.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <optional>
#include <thread>
#include <utility>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/status_notes.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/model_choice.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

std::string figures(const proto::CampaignStatus& status) {
  if (!status.storage_failure().empty()) {
    return fmt::format("{:3} %  nothing can be stored", percent_done(status));
  }
  if (status.num_done() == 0 && status.num_lent() > 0) {
    return fmt::format("{:3} %  computing the first {}", percent_done(status), status.num_lent());
  }
  std::string text = fmt::format("{:3} %", percent_done(status));
  if (status.rate_hz() > 0.0) text += fmt::format("  {} runs/s", rate_text(status));
  if (status.has_remaining_s() && status.num_done() < status.num_runs()) {
    text += fmt::format("  {} left", time_left_text(status));
  }
  return text;
}

}  // namespace

proto::CampaignStatus out_of(proto::CampaignStatus status, std::uint64_t num_runs,
                             std::uint64_t num_done_beside) {
  status.set_num_runs(num_runs);
  status.set_num_done(status.num_done() - num_done_beside);
  if (status.rate_hz() > 0.0) {
    status.set_remaining_s(static_cast<double>(num_runs - status.num_done()) / status.rate_hz());
  }
  return status;
}

std::string progress_bar(const proto::CampaignStatus& status, std::size_t columns_max) {
  const std::string left = fmt::format("{}/{} runs [", status.num_done(), status.num_runs());
  const std::string right = fmt::format("] {}", figures(status));
  const std::size_t used = left.size() + right.size();
  const std::size_t width = columns_max > used ? columns_max - used : 1;
  const std::size_t filled = width * percent_done(status) / 100;
  const std::string line =
      left + std::string(filled, '#') + std::string(width - filled, '.') + right;
  return line.substr(0, columns_max);
}

std::string progress_line(const proto::CampaignStatus& status) {
  return fmt::format("{}/{} runs  {}", status.num_done(), status.num_runs(), figures(status));
}

ProgressDisplay::ProgressDisplay(DisplayMode mode, std::FILE* stream)
    : mode_(mode), stream_(stream) {}

ProgressDisplay::~ProgressDisplay() {
  if (has_bar_) wire::say_on(stream_, "\n");
}

void ProgressDisplay::update(const proto::CampaignStatus& status) {
  if (mode_ == DisplayMode::bar) return show_bar(status);
  if (mode_ == DisplayMode::quiet) return;
  std::string gist =
      fmt::format("{} {}", percent_done(status) / 10, status.storage_failure().empty());
  if (gist == shown_) return;
  shown_ = std::move(gist);
  wire::say_on(stream_, progress_line(status) + "\n");
}

void ProgressDisplay::show_bar(const proto::CampaignStatus& status) {
  std::string line = progress_bar(status, screen_size_of(stream_).columns - 1);
  if (has_bar_ && line == shown_) return;
  // The longer line before it is wiped by the erasure to the end of the line.
  wire::say_on(stream_, fmt::format("\r{}\033[K", line));
  std::fflush(stream_);
  has_bar_ = true;
  shown_ = std::move(line);
}

void ProgressDisplay::note(std::string_view text, Tone tone) {
  if (has_bar_) wire::say_on(stream_, "\r\033[K");
  wire::say_on(stream_, in_tone(wire::visible_lines(text), tone, style_of(stream_).paint) + "\n");
  has_bar_ = false;
}

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
