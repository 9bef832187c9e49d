#include "coordinator/cli/notice_commands.hpp"

#include <optional>
#include <string_view>
#include <thread>

#include "core/error.hpp"
#include "proto/link/machine.hpp"

extern char** environ;

namespace proofmass::coordinator {
namespace {

std::vector<std::string> environment_for(const CampaignNotice& notice) {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable)
    variables.emplace_back(*variable);
  variables.push_back("PROOFMASS_CAMPAIGN=" + notice.campaign);
  variables.push_back("PROOFMASS_DATABASE=" + std::filesystem::absolute(notice.file).string());
  variables.push_back("PROOFMASS_REASON=" + notice.failure);
  return variables;
}

std::string_view option_of(const CampaignNotice& notice) {
  return notice.failure.empty() ? "on-finish" : "on-failure";
}

}  // namespace

const std::string& NoticeCommands::command_of(const CampaignNotice& notice) const {
  return notice.failure.empty() ? config_.on_finish : config_.on_failure;
}

void NoticeCommands::take(const CampaignNotice& notice) {
  if (command_of(notice).empty()) return;
  if (waiting_.size() == num_waiting_max) {
    return log_failure(notice, "too many commands wait; it is not started");
  }
  waiting_.push_back(notice);
  review();
}

void NoticeCommands::review() {
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

void NoticeCommands::start(const CampaignNotice& notice) {
  try {
    const pid_t process_id =
        wire::start_program({.arguments = {"/bin/sh", "-c", command_of(notice)},
                             .environment = environment_for(notice)});
    running_.push_back({.notice = notice, .process_id = process_id});
  } catch (const Error& error) {
    log_failure(notice, error.what());
  }
}

void NoticeCommands::log_failure(const CampaignNotice& notice, const std::string& reason) const {
  log_({.severity = Severity::warning,
        .kind = "command_failed",
        .fields = {
            {"command", option_of(notice)}, {"campaign", notice.campaign}, Field::reason(reason)}});
}

void NoticeCommands::wait(std::chrono::seconds duration_max) {
  const auto deadline = std::chrono::steady_clock::now() + duration_max;
  for (review(); !running_.empty() && std::chrono::steady_clock::now() < deadline; review()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace proofmass::coordinator
