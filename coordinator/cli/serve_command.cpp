#include "coordinator/cli/serve_command.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_start.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/report/report.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

spdlog::level::level_enum level_of(Severity severity) {
  switch (severity) {
    case Severity::info:
      return spdlog::level::info;
    case Severity::warning:
      return spdlog::level::warn;
    case Severity::error:
      return spdlog::level::err;
  }
  PROOFMASS_EXPECT(false);
}

Log log_to(Store& store) {
  return [&store](const Event& event) {
    spdlog::log(level_of(event.severity), "{} {}", event.kind, event.text);
    store.record_event(event.kind, event.text);
  };
}

}  // namespace

int serve_campaign(const ServeOptions& options) {
  wire::check_endpoint("bind", options.endpoint);
  const auto campaign =
      std::make_shared<const Campaign>(read_campaign(options.campaign_file, Overrides{}));
  spdlog::set_default_logger(spdlog::stderr_logger_st("proofmass-coordinator"));
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::drain);

  Store store = open_or_create(*campaign, options.database);
  const Log log = log_to(store);
  CampaignService service(campaign, store.finished_runs(), options.endpoint, commit_to(store, log),
                          log);
  spdlog::info("coordinator_started endpoint={} runs={} done={}", service.endpoint(),
               service.progress().num_runs, service.progress().num_done);
  const bool is_finished = service.run(stop, [] {});
  update_statistics(store, campaign->scenario);
  spdlog::info("coordinator_ended done={}", service.progress().num_done);
  return is_finished ? exit_done : exit_interrupted;
}

}  // namespace proofmass::coordinator
