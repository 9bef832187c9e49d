#include "coordinator/cli/serve_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_folder.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/signal_thread.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/report/report.hpp"
#include "core/campaign/model.hpp"
#include "proto/link/init_system.hpp"

namespace proofmass::coordinator {
namespace {

/// Tells the init system how the coordinator is.
class Notices {
 public:
  void on_tick(const Service& service, StopRequest stop) {
    using std::chrono::steady_clock;
    if (stop != StopRequest::none && !std::exchange(is_stopping_, true)) notify("STOPPING=1");
    const steady_clock::time_point now = steady_clock::now();
    const auto watchdog = init_system_.watchdog_interval();
    if (watchdog && take_turn(watchdog_at_, now, *watchdog)) notify("WATCHDOG=1");
    if (!take_turn(status_at_, now, status_interval)) return;
    std::size_t num_active = 0;
    for (const wire::CampaignStatus& campaign : service.campaigns()) {
      num_active += campaign.phase == wire::CampaignPhase::active ? 1U : 0U;
    }
    notify(fmt::format("STATUS={} campaigns to compute", num_active));
  }
  void ready() const { notify("READY=1"); }

 private:
  static constexpr std::chrono::seconds status_interval{5};

  using TimePoint = std::chrono::steady_clock::time_point;

  static bool take_turn(TimePoint& at, TimePoint now, std::chrono::microseconds interval) {
    if (now < at) return false;
    at = now + interval;
    return true;
  }
  void notify(std::string_view lines) const { init_system_.notify(lines); }

  wire::InitSystem init_system_ = wire::InitSystem::from_environment();
  bool is_stopping_ = false;
  TimePoint watchdog_at_ = TimePoint::min();
  TimePoint status_at_ = TimePoint::min();
};

/// Those of campaign files, new ones or such that have more runs than before.
std::vector<ServedCampaign> campaigns_of(const ServeOptions& options, CampaignFolder& folder) {
  std::vector<ServedCampaign> campaigns;
  for (const std::filesystem::path& file : options.campaign_files) {
    campaigns.push_back(folder.open(*read_campaign(file), {}, {}));
  }
  return campaigns;
}

/// Multiplies what a coordinator waits for workers and disks.
void scale_times(ServiceConfig& config, double factor) {
  DispatchConfig& dispatch = config.dispatch;
  for (Duration* const time :
       {&dispatch.heartbeat_interval, &dispatch.suspect_after, &dispatch.lost_after,
        &dispatch.arrival_max, &dispatch.hung_after_min, &dispatch.reattach_wait,
        &config.writer.retry_after}) {
    *time = std::chrono::duration_cast<Duration>(factor * *time);
  }
}

ServiceConfig config_of(const ServeOptions& options, CampaignFolder& folder) {
  ServiceConfig config;
  config.workers_endpoint = options.endpoint;
  config.clients_endpoint = options.clients_endpoint.value_or(
      "ipc://" + (std::filesystem::absolute(options.directory) / "clients").string());
  config.keys = options.keys;
  config.is_plain_waived = options.is_plain_waived;
  config.end = options.end;
  config.drain_max =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(options.drain_time_s));
  config.memory_size_max = options.memory_mib_max << 20;
  config.files = &folder;
  config.directory = &folder;
  config.limits = options.limits;
  config.version = PROOFMASS_VERSION;
  config.dispatch.reference_digest = model().reference_digest(best_instruction_set());
  if (!options.faults.empty()) config.faults = wire::FaultPlan::parse(options.faults);
  scale_times(config, options.time_scale);
  return config;
}

void log_start(const Service& service, const Log& log) {
  log({.kind = "coordinator_started",
       .fields = {{"bind", service.workers_endpoint()},
                  {"bind_clients", service.clients_endpoint()},
                  {"campaigns", service.campaigns().size()}}});
}

/// Brings the statistics of the campaigns that are still open up to date.
/// @return False if they could not all be written.
bool finish(std::vector<ServedCampaign> campaigns, const Log& log) {
  bool is_written = true;
  for (auto& [file, store, definition] : campaigns) {
    try {
      update_statistics(store, *definition);
      if (const std::optional<std::string> reason = store.rest()) {
        log({.severity = Severity::warning,
             .kind = "write_ahead_log_kept",
             .fields = {{"file", file.string()}, Field::reason(*reason)}});
      }
    } catch (const std::exception& error) {
      is_written = false;
      log({.severity = Severity::error,
           .kind = "statistics_failed",
           .fields = {{"file", file.string()}, Field::reason(error.what())}});
    }
  }
  return is_written;
}

bool has_given_up_runs(const Service& service) {
  const std::vector<wire::CampaignStatus> campaigns = service.campaigns();
  return std::any_of(campaigns.begin(), campaigns.end(),
                     [](const wire::CampaignStatus& one) { return one.num_given_up > 0; });
}

}  // namespace

int serve_campaigns(const ServeOptions& options) {
  const Log log = wire::make_log("proofmass-coordinator", options.log_format, wire::LogLevel::info);
  const SignalThread signals;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::drain);
  CampaignFolder folder(options.directory);
  const ServiceConfig config = config_of(options, folder);
  if (config.faults && config.faults->kill) {
    wire::arm_kill_point(config.faults->kill->point, config.faults->kill->passage);
  }
  Service service(campaigns_of(options, folder), config, log);
  log_start(service, log);
  Notices notices;
  notices.ready();
  service.run(stop, [&] { notices.on_tick(service, stop); });
  const bool is_done = service.is_done();
  const bool has_given_up = has_given_up_runs(service);
  const std::size_t num_campaigns = service.campaigns().size();
  const bool is_written = finish(service.close(), log);
  log({.kind = "coordinator_ended", .fields = {{"campaigns", num_campaigns}}});
  if (!is_written || service.has_storage_failed()) return exit_cannot_be_done;
  const bool is_in_order =
      options.end == ServiceEnd::when_done ? is_done : stop != StopRequest::now;
  if (!is_in_order) return exit_interrupted;
  return has_given_up && options.end == ServiceEnd::when_done ? exit_cannot_be_done : exit_done;
}

}  // namespace proofmass::coordinator
