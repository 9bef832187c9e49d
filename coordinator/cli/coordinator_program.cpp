#include <fmt/format.h>
#include <sys/types.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/page/page.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/log.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/model_choice.hpp"
#include "proto/model_program/program_model.hpp"
#include "proto/wire/endpoint.hpp"

extern char** environ;

namespace proofmass::coordinator {
namespace {

/// Starts the commands that the options --on-finish and --on-failure of a coordinator name, and
/// follows them to their end. The service never waits for one.
class NoticeCommands {
 public:
  /// Lines of `sh`; empty for none.
  struct Config {
    std::string on_finish;
    std::string on_failure;
  };

  NoticeCommands(Config config, Log log) : config_(std::move(config)), log_(std::move(log)) {}

  /// Starts the command for the notice, or lets it wait while many run. The command finds
  /// PROOFMASS_CAMPAIGN, PROOFMASS_DATABASE and, after a failure, PROOFMASS_REASON in its
  /// environment.
  void take(const CampaignNotice& notice) {
    if (command_of(notice).empty()) return;
    constexpr std::size_t num_waiting_max = 10'000;
    if (waiting_.size() == num_waiting_max) {
      return log_failure(notice, "too many commands wait; it is not started");
    }
    waiting_.push_back(notice);
    review();
  }

  /// Starts commands that wait, and logs those that failed. To be called many times a second.
  void review() {
    constexpr std::size_t num_running_max = 16;
    std::erase_if(running_, [&](const Running& running) {
      const std::optional<int> status = wire::status_if_ended(running.process_id);
      if (!status) return false;
      if (*status != 0) log_failure(running.notice, wire::end_text(*status));
      return true;
    });
    while (!waiting_.empty() && running_.size() < num_running_max) {
      const CampaignNotice notice = std::move(waiting_.front());
      waiting_.pop_front();
      start(notice);
    }
  }

  /// Waits for the commands that run or wait, at most so long. Those that still run go on.
  void wait(std::chrono::seconds duration_max) {
    const auto deadline = std::chrono::steady_clock::now() + duration_max;
    for (review(); !running_.empty() && std::chrono::steady_clock::now() < deadline; review()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

 private:
  struct Running {
    CampaignNotice notice;
    pid_t process_id = 0;
  };

  [[nodiscard]] const std::string& command_of(const CampaignNotice& notice) const {
    return notice.failure.empty() ? config_.on_finish : config_.on_failure;
  }

  void start(const CampaignNotice& notice) {
    std::vector<std::string> environment;
    for (char** variable = environ; *variable != nullptr; ++variable) {
      environment.emplace_back(*variable);
    }
    environment.push_back("PROOFMASS_CAMPAIGN=" + notice.campaign);
    environment.push_back("PROOFMASS_DATABASE=" + std::filesystem::absolute(notice.file).string());
    environment.push_back("PROOFMASS_REASON=" + notice.failure);
    try {
      const pid_t process_id =
          wire::start_program({.arguments = {"/bin/sh", "-c", command_of(notice)},
                               .environment = std::move(environment)});
      running_.push_back({.notice = notice, .process_id = process_id});
    } catch (const Error& error) {
      log_failure(notice, error.what());
    }
  }

  void log_failure(const CampaignNotice& notice, const std::string& reason) const {
    const std::string_view option = notice.failure.empty() ? "on-finish" : "on-failure";
    log_({.severity = Severity::warning,
          .kind = "command_failed",
          .fields = {{"command", option}, {"campaign", notice.campaign}, Field::reason(reason)}});
  }

  Config config_;
  Log log_;
  std::deque<CampaignNotice> waiting_;
  std::vector<Running> running_;
};

constexpr std::chrono::seconds command_wait_max(60);
constexpr std::uint64_t memory_mib_min = 64;
constexpr std::uint64_t memory_mib_max = std::uint64_t{1} << 24;
constexpr std::size_t workers_max_max = 65'536;
constexpr std::size_t campaigns_per_key_max = 1'000'000;
constexpr std::uint64_t bytes_per_key_max = std::uint64_t{1} << 50;

struct ServeOptions {
  std::filesystem::path directory;      ///< Of the campaign databases.
  ServiceConfig service;                ///< As far as options set it; see config_of().
  std::uint64_t memory_mib_max = 2048;  ///< ≥ 64; of the process.
  PageConfig page;
  NoticeCommands::Config commands;
  wire::LogFormat log_format = wire::LogFormat::text;
  double time_scale = 1.0;  ///< > 0; of all that is waited for. Below 1 in tests of this program.
  std::vector<std::filesystem::path> campaign_files;  ///< To be served beside those that are there.
};

std::string status_of(const Service& service) {
  const std::vector<proto::CampaignStatus> campaigns = service.campaigns();
  const auto num_active =
      std::ranges::count(campaigns, proto::CAMPAIGN_PHASE_ACTIVE, &proto::CampaignStatus::phase);
  return fmt::format("{} campaigns to compute", num_active);
}

/// The campaigns of campaign files: new ones, or such that have more runs than before.
std::vector<ServedCampaign> campaigns_of(const ServeOptions& options, CampaignFolder& folder) {
  std::vector<std::unique_ptr<const Campaign>> wanted;  // All, before a database is made.
  for (const std::filesystem::path& file : options.campaign_files) {
    wanted.push_back(read_campaign(file));
    const std::string& name = wanted.back()->name;
    if (std::ranges::count(wanted, name, [](const auto& one) { return one->name; }) == 1) continue;
    throw UsageError(fmt::format("FILE = {} (campaign {} is given twice)", file.string(), name));
  }
  std::vector<ServedCampaign> campaigns;
  for (const auto& campaign : wanted) campaigns.push_back(folder.open(*campaign, {}, {}));
  return campaigns;
}

/// Multiplies what a coordinator waits for workers and disks.
void scale_times(ServiceConfig& config, double factor) {
  DispatchConfig& dispatch = config.dispatch;
  for (Duration* const time :
       {&dispatch.heartbeat_interval, &dispatch.suspect_after, &dispatch.lost_after,
        &dispatch.lost_after_if_behind, &dispatch.arrival_max, &dispatch.hung_after_min,
        &dispatch.reattach_wait, &dispatch.lease_duration_max, &dispatch.lone_witness_wait,
        &dispatch.quarantine_duration, &config.writer.retry_after}) {
    *time = std::chrono::duration_cast<Duration>(factor * *time);
  }
}

/// The program that answers questions about results; nothing where only the coordinator is
/// installed.
std::filesystem::path answer_program() {
  try {
    return wire::program_beside_this("proofmass");
  } catch (const Error&) {
    return {};
  }
}

ServiceConfig config_of(const ServeOptions& options, CampaignFolder& folder) {
  ServiceConfig config = options.service;
  if (!config.clients_endpoint) {
    config.clients_endpoint =
        "ipc://" + (std::filesystem::absolute(options.directory) / "clients").string();
    wire::check_endpoint("--bind-clients, by default in --directory,", *config.clients_endpoint,
                         wire::EndpointUse::bind, wire::Protection::none);
  }
  config.memory_size_max = options.memory_mib_max << 20;
  config.files = &folder;
  config.directory = &folder;
  config.answer_program = answer_program();
  config.answer_directory = folder.answers();
  config.version = PROOFMASS_VERSION;
  config.dispatch.hosts_per_key_max =
      std::max(config.dispatch.hosts_per_key_max, config.dispatch.num_workers_max);
  config.dispatch.reference_digest = built_in_model().reference_digest(best_instruction_set());
  scale_times(config, options.time_scale);
  return config;
}

/// Brings the statistics of the campaigns that are still open up to date.
/// @return False if they could not all be written.
bool finish(std::vector<ServedCampaign> campaigns, const Log& log) {
  bool is_written = true;
  for (ServedCampaign& campaign : campaigns) {
    const std::string file = campaign.file.string();
    try {
      update_statistics(campaign.store, *campaign.definition);
      if (const std::optional<std::string> reason = campaign.store.rest()) {
        log({.severity = Severity::warning,
             .kind = "write_ahead_log_kept",
             .fields = {{"file", file}, Field::reason(*reason)}});
      }
    } catch (const std::exception& error) {
      is_written = false;
      log({.severity = Severity::error,
           .kind = "statistics_failed",
           .fields = {{"file", file}, Field::reason(error.what())}});
    }
  }
  return is_written;
}

/// Serves all campaigns of a directory to the workers that connect.
/// @return An ExitCode.
int serve_campaigns(const ServeOptions& options) {
  wire::ignore_broken_pipes();  // The service outlives what reads its log.
  wire::require_threads(num_service_threads);
  options.page.validate();
  const Log log = wire::make_log("proofmass-coordinator", options.log_format, wire::LogLevel::info);
  const SignalThread signals;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::drain);
  CampaignFolder folder(options.directory);
  ServiceConfig config = config_of(options, folder);
  NoticeCommands commands(options.commands, log);
  config.on_notice = [&](const CampaignNotice& notice) { commands.take(notice); };
  if (options.page.is_wanted()) config.num_descriptors_reserved = page_descriptors_max();
  Service service(campaigns_of(options, folder), config, log);
  std::optional<Page> page;
  if (options.page.is_wanted()) page.emplace(options.page, log);
  wire::end_fresh_programs();  // Workers have their own.
  log({.kind = "coordinator_started",
       .fields = {{"bind", service.workers_endpoint()},
                  {"bind_clients", service.clients_endpoint()},
                  {"campaigns", service.campaigns().size()}}});
  wire::ServiceNotices notices;
  notices.ready();
  service.run(stop, [&] {
    if (stop != StopRequest::none) notices.stopping();
    commands.review();
    if (page) page->on_turn(service);
    notices.on_tick(std::chrono::steady_clock::now(), [&] { return status_of(service); });
  });
  notices.stopping();               // The service may have ended between two turns.
  page.reset();                     // It may be reading files, too.
  commands.wait(command_wait_max);  // Before the files are closed, which they may be reading.
  const bool is_done = service.is_done();
  const std::vector<proto::CampaignStatus> campaigns = service.campaigns();
  const bool has_given_up =
      std::ranges::any_of(campaigns, [](const auto& one) { return one.num_given_up() > 0; });
  const bool is_written = finish(service.close(), log);
  log({.kind = "coordinator_ended", .fields = {{"campaigns", campaigns.size()}}});
  if (!is_written || service.has_storage_failed()) return exit_cannot_be_done;
  const bool is_in_order =
      options.service.end == ServiceEnd::when_done ? is_done : stop != StopRequest::now;
  if (!is_in_order) return exit_interrupted;
  return has_given_up && options.service.end == ServiceEnd::when_done ? exit_cannot_be_done
                                                                      : exit_done;
}

void add_addresses(CLI::App& app, ServeOptions& options) {
  app.add_option("--bind", options.service.workers_endpoint,
                 "Where workers connect, ipc://PATH or\ntcp://HOST:PORT")
      ->envname("PROOFMASS_BIND")
      ->required();
  app.add_option("--bind-clients", options.service.clients_endpoint,
                 "Where clients connect; a socket in the\ndirectory by default")
      ->envname("PROOFMASS_BIND_CLIENTS");
  add_path(app, wire::directory_type, "--keys", options.service.keys,
           "Directory of keys, made by `proofmass keygen`")
      ->envname("PROOFMASS_KEYS");
  app.add_flag("--insecure-plain", options.service.is_plain_waived,
               "Serve other machines without keys: on a\nnetwork that you trust");
}

void add_service(CLI::App& app, ServeOptions& options) {
  add_path(app, campaign_file_type, "FILE", options.campaign_files,
           "Campaign files (TOML) to serve as well");
  add_path(app, wire::directory_type, "--directory", options.directory,
           "Directory of the campaigns, one NAME.db each")
      ->envname("PROOFMASS_DIRECTORY")
      ->required();
  app.add_flag_callback(
      "--exit-when-done", [&end = options.service.end] { end = ServiceEnd::when_done; },
      "End when every campaign is finished");
  wire::add_duration(
      app, "--drain-time", options.service.drain_max,
      "Time that workers have after SIGTERM to deliver\nwhat they hold; 120s by default");
  add_number(app, "--memory-max", options.memory_mib_max, {memory_mib_min, memory_mib_max},
             "Memory in MiB; near this limit it closes all\nconnections, and peers connect again")
      ->envname("PROOFMASS_MEMORY_MAX");
  add_number(app, "--workers-max", options.service.dispatch.num_workers_max, {1, workers_max_max},
             "Workers that may be registered at a time;\nothers are refused and ask again");
  add_number(app, "--campaigns-per-key", options.service.limits.campaigns_max,
             {1, campaigns_per_key_max},
             "Unfinished campaigns that a client's key may\nhave, at most");
  add_number(app, "--bytes-per-key", options.service.limits.size_max, {1, bytes_per_key_max},
             "Bytes of the definitions of these campaigns,\nat most");
  app.add_option("--on-finish", options.commands.on_finish,
                 "Command for `sh` when a campaign is finished;\n$PROOFMASS_DATABASE is its file")
      ->type_name("COMMAND");
  app.add_option("--on-failure", options.commands.on_failure,
                 "The same when one has failed; $PROOFMASS_REASON\nsays why")
      ->type_name("COMMAND");
  static const std::map<std::string, wire::LogFormat> formats{{"json", wire::LogFormat::json},
                                                              {"text", wire::LogFormat::text}};
  wire::add_choice(app, "--log-format", options.log_format, formats,
                   "Format of the log; text by default")
      ->envname("PROOFMASS_LOG_FORMAT");
  // For tests of the program by itself.
  wire::add_fault_option(app);
  app.add_option("--time-scale", options.time_scale)->group("")->check(CLI::PositiveNumber);
}

}  // namespace

int run_proofmass_coordinator(int argc, char** argv) {
  const auto refused = refused_model(argc, argv, "proofmass-coordinator", wire::Broken::refused);
  if (refused) return *refused;
  CLI::App app(
      "Lends the runs of campaigns to workers and stores their results.\n"
      "On SIGTERM it first lets workers deliver their results; on SIGINT or a second\n"
      "SIGTERM it ends at once; on SIGHUP it leaves workers to the next coordinator.",
      "proofmass-coordinator");
  app.footer(exit_codes_text({}) +
             "\n  130  interrupted by SIGINT, with --exit-when-done also by SIGTERM; what is\n"
             "       stored stands");
  app.set_version_flag("--version", fmt::format("proofmass-coordinator {} ({})", PROOFMASS_VERSION,
                                                model().version()));
  wire::add_option_file(app, "File with these options, as in\n`bind = \"tcp://*:5555\"`",
                        "PROOFMASS_COORDINATOR_CONFIG");
  ServeOptions options;
  add_service(app, options);
  add_addresses(app, options);
  add_page_options(app, options.page);
  wire::add_model_program_option(app);
  return run_program(app, argc, argv, [&] { return serve_campaigns(options); });
}

}  // namespace proofmass::coordinator
