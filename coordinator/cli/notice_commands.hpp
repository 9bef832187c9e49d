#pragma once

#include <sys/types.h>

#include <chrono>
#include <deque>
#include <string>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// Starts the commands that the options --on-finish and --on-failure of a coordinator name, and
/// follows them to their end. The service never waits for one.
class NoticeCommands {
 public:
  static constexpr std::size_t num_running_max = 16;
  static constexpr std::size_t num_waiting_max = 10'000;

  /// Lines of `sh`; empty for none.
  struct Config {
    std::string on_finish;
    std::string on_failure;
  };

  NoticeCommands(Config config, Log log) : config_(std::move(config)), log_(std::move(log)) {}

  /// Starts the command for the notice, or lets it wait while many run. The command finds
  /// PROOFMASS_CAMPAIGN, PROOFMASS_DATABASE and, after a failure, PROOFMASS_REASON in its
  /// environment.
  void take(const CampaignNotice& notice);

  /// Starts commands that wait, and logs those that failed. To be called many times a second.
  void review();

  /// Waits for the commands that run or wait, at most so long. Those that still run go on.
  void wait(std::chrono::seconds duration_max);

 private:
  struct Running {
    CampaignNotice notice;
    pid_t process_id = 0;
  };

  [[nodiscard]] const std::string& command_of(const CampaignNotice& notice) const;
  void start(const CampaignNotice& notice);
  void log_failure(const CampaignNotice& notice, const std::string& reason) const;

  Config config_;
  Log log_;
  std::deque<CampaignNotice> waiting_;
  std::vector<Running> running_;
};

}  // namespace proofmass::coordinator
