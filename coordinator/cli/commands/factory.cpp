#include "coordinator/factory/factory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/status_notes.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/log.hpp"
#include "proto/link/machine.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::uint64_t workers_max_max = 10'000;
constexpr std::uint64_t walltime_min_min = 10;
constexpr std::uint64_t walltime_min_max = 366 * 24 * 60;

/// The worker leaves this long before its allocation ends: what comes before it starts takes time.
constexpr std::chrono::seconds start_margin{60};

struct FactoryOptions {
  ClientOptions client;
  BatchSystem system;
  FactoryConfig factory;  ///< But for the walltime, the name in the queue and the command.
  std::string worker_keys;
  std::string start_command;
  std::string wrap_command;
  std::uint64_t walltime_min = 480;
  std::uint64_t idle_timeout_s = 300;
  bool ends_when_done = false;
  bool is_dry_run = false;
};

std::string checked_line(std::string_view option, const std::string& text) {
  if (text.find('\n') == std::string::npos) return text;
  throw UsageError(fmt::format("--{} (must be one line)", option));
}

std::string worker_command(const FactoryOptions& options) {
  std::string command;
  if (!options.start_command.empty()) {
    command += checked_line("worker-start-cmd", options.start_command) + " && ";
  }
  command += "exec ";
  if (!options.wrap_command.empty()) {
    command += checked_line("worker-wrap-cmd", options.wrap_command) + " ";
  }
  const auto walltime = std::chrono::minutes(options.walltime_min) - start_margin;
  command +=
      fmt::format("proofmass-worker --connect {} --name {}-\"$1\" --max-walltime {}s",
                  wire::shell_word(checked_line("worker-connect", options.factory.worker_endpoint)),
                  options.factory.name, walltime.count());
  command += fmt::format(" --idle-timeout {}s", options.idle_timeout_s);
  if (!options.worker_keys.empty()) {
    command +=
        " --keys " +
        wire::shell_word(
            std::filesystem::absolute(checked_line("worker-keys", options.worker_keys)).string());
  }
  if (const auto num_processors = options.factory.num_processors) {
    command += fmt::format(" --threads {}", *num_processors);
  }
  return command;
}

FactoryConfig checked(const FactoryOptions& options) {
  FactoryConfig config = options.factory;
  config.walltime = std::chrono::minutes(options.walltime_min);
  config.batch_system = options.system.name;
  // A worker's name is this one with an identifier of 64 characters at most.
  constexpr std::size_t name_size_max = 60;
  if (!wire::is_name(config.name) || config.name.size() > name_size_max) {
    throw UsageError(fmt::format("--name = \"{}\" (must be 1 to {} of {})", config.name,
                                 name_size_max, name_rule));
  }
  if (config.workers_min > config.workers_max) {
    throw UsageError(fmt::format("--workers-min = {} (must be at most --workers-max, {})",
                                 config.workers_min, config.workers_max));
  }
  // Also campaign.sbatch, and a factory of another coordinator, may be called `proofmass`. Older
  // versions of PBS take 15 characters.
  const std::string coordinator = config.worker_endpoint + " " + options.client.connection.endpoint;
  config.queue_name = fmt::format("{}-{:05x}", config.name, fnv1a(coordinator) & 0xfffff);
  config.worker_command = worker_command(options);
  if (options.system.running.empty()) {
    config.workers_log = std::filesystem::absolute(config.name + "-workers.log").string();
    if (!options.worker_keys.empty() && !std::filesystem::is_directory(options.worker_keys)) {
      throw UsageError(
          fmt::format("--worker-keys = {} (must be a directory)", options.worker_keys));
    }
  }
  for (const std::string& option : config.submit_options) {
    (void)checked_line("submit-option", option);
  }
  return config;
}

int show_submission(const BatchSystem& system, const FactoryConfig& config) {
  const BatchCommand command = system.submission(config);
  std::string text;
  for (const std::string& argument : command.arguments) text += wire::shell_word(argument) + " ";
  text.back() = '\n';
  print_lines(text + command.input);
  return exit_done;
}

/// A campaign that is over, or paused by a person, is not worked for.
FactoryView view_of(const proto::StatusReply& status, const proto::WorkersReply& workers) {
  FactoryView view;
  for (const proto::CampaignStatus& campaign : status.campaigns()) {
    view.rate_hz += campaign.rate_hz();
    if (campaign.phase() != proto::CAMPAIGN_PHASE_ACTIVE) continue;
    view.num_open_runs += campaign.num_runs() - campaign.num_done() - campaign.num_given_up();
  }
  for (const auto& worker : workers.workers()) view.workers.insert(worker.name());
  return view;
}

/// Keeps workers for a coordinator; one object lives as long as the command.
class FactoryLoop {
 public:
  FactoryLoop(const FactoryOptions& options, FactoryConfig config, const wire::Log& log)
      : options_(options),
        config_(std::move(config)),
        log_(log),
        report_(report_of({}, config_, {}, std::chrono::steady_clock::now())) {}

  /// One look at coordinator and queue, and what follows from it. What fails is tried again at the
  /// next look.
  /// @return Whether all campaigns are over.
  bool advance() {
    try {
      ClientConnection connection(options_.client.connection);
      const Ask ask = [&](const proto::RequestEnvelope& request) {
        return connection.ask(request);
      };
      const proto::StatusReply status = whole_status(ask);
      const bool has_looked = look_at_queue(view_of(status, all_workers(ask)));
      report(ask);
      const bool are_over =
          !status.campaigns().empty() && std::ranges::all_of(status.campaigns(), is_over);
      num_unlisted_ = are_over && !has_looked ? num_unlisted_ + 1 : 0;
      return has_looked && are_over;
    } catch (const InvalidArgument&) {
      throw;  // The address is wrong.
    } catch (const Error& error) {
      log_waiting(error.what());
      return false;
    }
  }

  /// Workers may be left in a queue that is never listed, and nothing else is to be done.
  [[nodiscard]] std::optional<std::string> reason_to_end() const {
    if (num_unlisted_ >= unlisted_max) {
      return fmt::format(
          "all campaigns are over, and {} times in a row the queue was not listed: {}",
          num_unlisted_, report_.reason());
    }
    return reason_to_pause(state_);
  }

 private:
  static constexpr int unlisted_max = 10;

  void log_waiting(const std::string& reason) const {
    log_({.severity = wire::Severity::warning,
          .kind = "factory_waits",
          .fields = {wire::Field::reason(reason)}});
  }

  /// @return Whether the queue could be listed.
  bool look_at_queue(FactoryView view) {
    try {
      const BatchSystem& system = options_.system;
      view.allocations = allocations_of(system, config_, output_of(system.listing(config_)));
    } catch (const Error& error) {
      note_unlisted(error.what());
      return false;
    }
    carry_out(on_view(state_, config_, view, std::chrono::steady_clock::now(), log_), state_,
              options_.system, config_, log_);
    const bool was_paused = report_.phase() == proto::FACTORY_PHASE_PAUSED;
    report_ = report_of(state_, config_, view, std::chrono::steady_clock::now());
    if (report_.phase() == proto::FACTORY_PHASE_PAUSED && !was_paused) {
      log_({.severity = wire::Severity::error,
            .kind = "factory_paused",
            .fields = {wire::Field::reason(report_.reason())}});
    }
    return true;
  }

  void note_unlisted(const std::string& reason) {
    log_waiting(reason);
    if (report_.phase() == proto::FACTORY_PHASE_PAUSED) return;
    report_.set_phase(proto::FACTORY_PHASE_WAITING);
    report_.set_wait_s(static_cast<double>(config_.interval_s));
    report_.set_reason(reason);
  }

  /// Nothing depends on the report, which an older coordinator does not know.
  void report(const Ask& ask) {
    proto::RequestEnvelope request;
    *request.mutable_factory_report() = report_;
    const std::string reason = ask(request).error().text();
    if (!reason.empty() && reason != refused_because_) {
      log_({.severity = wire::Severity::warning,
            .kind = "report_refused",
            .fields = {wire::Field::reason(reason)}});
    }
    refused_because_ = reason;
  }

  const FactoryOptions& options_;
  FactoryConfig config_;
  const wire::Log& log_;
  FactoryState state_;
  proto::FactoryReport report_;  ///< After the last look.
  std::string refused_because_;  ///< The last report; empty if it was taken.
  int num_unlisted_ = 0;         ///< Looks in a row without the queue, all campaigns being over.
};

int keep_workers(const FactoryOptions& options) {
  wire::ignore_broken_pipes();  // Workers are wanted also when nobody reads its log.
  const FactoryConfig config = checked(options);
  if (options.is_dry_run) return show_submission(options.system, config);
  const bool is_json = options.client.format == OutputFormat::json;
  const wire::Log log =
      wire::make_log("proofmass-factory", is_json ? wire::LogFormat::json : wire::LogFormat::text,
                     wire::LogLevel::info);
  const SignalThread signals;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  (void)ClientConnection(options.client.connection);  // Wrong addresses and keys end it at once.
  warn_if_plain(options.client);
  FactoryLoop loop(options, config, log);
  while (stop == StopRequest::none) {
    const bool are_all_over = loop.advance();
    if (are_all_over && options.ends_when_done) return exit_done;
    const auto reason = loop.reason_to_end();
    if (reason && options.ends_when_done) throw Error("factory: " + *reason);
    const auto next = std::chrono::steady_clock::now() + std::chrono::seconds(config.interval_s);
    while (stop == StopRequest::none && std::chrono::steady_clock::now() < next) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
  return exit_interrupted;
}

void add_sizing(CLI::App& command, FactoryOptions& options) {
  FactoryConfig& factory = options.factory;
  add_number(command, "--workers-max", factory.workers_max, {1, workers_max_max},
             "Workers of this factory, at most");
  add_number(command, "--workers-min", factory.workers_min, {0, workers_max_max},
             "Workers, at least, while any run is open");
  add_number(command, "--backlog", factory.backlog, {1, workers_max_max},
             "Workers in the queue that have not registered,\nat most");
  add_number(command, "--utilisation-min", factory.utilisation_min, {0.001, 1.0},
             "A worker is asked for if there is work for this\nshare of its walltime");
  add_number(command, "--interval", factory.interval_s, {1, wire::factory_interval_s_max},
             "Seconds between two looks");
  command.add_flag("--exit-when-done", options.ends_when_done,
                   "End when every campaign is finished; end with\nan error instead of pausing");
}

void add_workers_of(CLI::App& command, FactoryOptions& options) {
  command
      .add_option("--worker-connect", options.factory.worker_endpoint,
                  "The coordinator's address for workers")
      ->required();
  command.add_option("--worker-keys", options.worker_keys,
                     "Directory of the worker's keys, on its node");
  add_number(command, "--walltime", options.walltime_min, {walltime_min_min, walltime_min_max},
             "Minutes that a worker has");
  add_number(command, "--idle-timeout", options.idle_timeout_s, {1, 24 * 3600},
             "Seconds without work after which a worker ends");
  add_number(command, "--processors", options.factory.num_processors, {1, 256},
             "Processors of a worker; by default it has a\nnode of its own");
  command.add_option("--worker-start-cmd", options.start_command,
                     "Line of bash before the worker starts, e.g.\n'module load proofmass'");
  command.add_option("--worker-wrap-cmd", options.wrap_command,
                     "Words before proofmass-worker, e.g.\n'apptainer exec proofmass.sif'");
  command
      .add_option("--submit-option", options.factory.submit_options,
                  "Further option of sbatch or qsub, or line of a\nsubmit description; repeatable")
      ->allow_extra_args(false);
}

}  // namespace

void add_factory(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<FactoryOptions>(
      app, chosen, "factory", "Keep workers in the queue of a batch system", keep_workers);
  static const std::map<std::string, BatchSystem> systems = [] {
    std::map<std::string, BatchSystem> by_name;
    for (const BatchSystem& system : batch_systems()) by_name.emplace(system.name, system);
    return by_name;
  }();
  wire::add_choice(command, "--batch-system", options.system, systems,
                   "Where workers are queued; local starts them\nhere")
      ->required();
  command.add_option("--name", options.factory.name, "Of the factory and its allocations")
      ->capture_default_str();
  command.add_flag("--dry-run", options.is_dry_run, "Print how a worker would be queued, and end");
  add_workers_of(command, options);
  add_sizing(command, options);
  add_client_options(command, options.client);
  command.footer(exit_codes_text({exit_interrupted}));
}

}  // namespace proofmass::coordinator
