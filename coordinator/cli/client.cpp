#include "coordinator/cli/client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/net/answers.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/endpoint.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double timeout_s_min = 0.01;
constexpr double timeout_s_max = 86400.0;

void add_key_options(CLI::App& command, ClientConnectionConfig& connection) {
  add_path(command, wire::directory_type, "--keys", connection.keys,
           "Directory with client.key and coordinator.pub")
      ->envname("PROOFMASS_KEYS");
  command.add_flag("--insecure-plain", connection.is_plain_waived,
                   "Allow an address beyond this machine without keys");
}

}  // namespace

void add_client_options(CLI::App& command, ClientOptions& options) {
  ClientConnectionConfig& connection = options.connection;
  command
      .add_option("--connect", connection.endpoint,
                  "The coordinator's address for clients,\ne.g. tcp://127.0.0.1:5556")
      ->envname("PROOFMASS_CLIENT_CONNECT")
      ->required();
  add_key_options(command, connection);
  command
      .add_option_function<double>(
          "--timeout",
          [&connection](double timeout_s) {
            connection.reply_wait = std::chrono::duration<double>(timeout_s);
          },
          "Seconds to wait for an answer; 10 by default")
      ->check(wire::in_range(timeout_s_min, timeout_s_max));
  add_json_flag(command, options.format);
}

void warn_if_plain(const ClientOptions& options) {
  const ClientConnectionConfig& connection = options.connection;
  if (connection.keys || wire::is_local(connection.endpoint)) return;
  wire::say(fmt::format(
      "proofmass: warning: connect = {} (--insecure-plain: anybody on the network can read "
      "and change messages)\n",
      connection.endpoint));
}

Ask connected(const ClientOptions& options) {
  const auto connection = std::make_shared<ClientConnection>(options.connection);
  warn_if_plain(options);
  return [connection](const proto::RequestEnvelope& request) { return connection->ask(request); };
}

proto::ReplyEnvelope reply_of(const Ask& ask, const proto::RequestEnvelope& request,
                              proto::ReplyEnvelope::ReplyCase kind) {
  proto::ReplyEnvelope reply = ask(request);
  if (reply.has_error()) throw Error(reply.error().text());
  if (reply.reply_case() == kind) return reply;
  throw Error("reply = of another kind (must be that of the request)");
}

// Campaigns are only ever added to the end of a coordinator's list.
proto::StatusReply whole_status(const Ask& ask) {
  const auto page_from = [&](std::uint64_t first_campaign) {
    proto::RequestEnvelope request;
    request.mutable_status()->set_first_campaign(first_campaign);
    return reply_of(ask, request, proto::ReplyEnvelope::kStatus).status();
  };
  proto::StatusReply status = page_from(0);
  const auto num_read = [&] { return static_cast<std::uint64_t>(status.campaigns_size()); };
  while (num_read() < status.num_campaigns()) {
    const proto::StatusReply page = page_from(num_read());
    if (page.campaigns().empty()) break;  // It has fewer now: it was started again.
    status.mutable_campaigns()->MergeFrom(page.campaigns());
  }
  return status;
}

proto::WorkersReply all_workers(const Ask& ask) {
  const auto page_after = [&](std::uint64_t worker_id) {
    proto::RequestEnvelope request;
    request.mutable_workers()->set_after_worker_id(worker_id);
    return reply_of(ask, request, proto::ReplyEnvelope::kWorkers).workers();
  };
  proto::WorkersReply workers = page_after(0);
  bool is_more = !workers.workers().empty() &&
                 static_cast<std::uint64_t>(workers.workers_size()) < workers.num_workers();
  while (is_more) {
    const proto::WorkersReply page = page_after(workers.workers().rbegin()->worker_id());
    is_more = !page.workers().empty();
    workers.mutable_workers()->MergeFrom(page.workers());
  }
  return workers;
}

std::string checked_campaign_name(const std::string& name) {
  check_campaign_name(name, NameOrigin::given);
  return name;
}

// Questions about results.

void add_optional_connection(CLI::App& command, ClientConnectionConfig& connection) {
  command.add_option("--connect", connection.endpoint,
                     "Ask the coordinator with this address for\nclients; DB is a campaign's name");
  add_key_options(command, connection);
}

bool is_remote(const ClientConnectionConfig& connection, const std::filesystem::path& database) {
  if (!connection.endpoint.empty()) return true;
  std::error_code error;
  const std::string name = database.string();
  const bool may_be_campaign = wire::is_name(name) && !database.has_extension();
  if (!may_be_campaign || std::filesystem::exists(database, error)) return false;
  throw Error(
      fmt::format("campaign database = {} (does not exist; a file ends in .db, and a campaign "
                  "of a coordinator needs --connect)",
                  name));
}

proto::RequestEnvelope question_about(const std::string& campaign, proto::Question question) {
  proto::RequestEnvelope request;
  request.mutable_answer()->set_campaign(checked_campaign_name(campaign));
  request.mutable_answer()->set_question(question);
  return request;
}

void read_answer(const Ask& ask, const proto::AnswerReply& answer,
                 const std::function<void(std::string_view)>& take) {
  proto::RequestEnvelope request;
  proto::AnswerPartRequest& wanted = *request.mutable_answer_part();
  wanted.set_answer_id(answer.answer_id());
  wanted.set_offset(answer.offset());
  while (wanted.offset() < answer.size()) {
    const proto::ReplyEnvelope reply = reply_of(ask, request, proto::ReplyEnvelope::kAnswerPart);
    const std::string& content = reply.answer_part().content();
    if (content.empty()) return;
    take(content);
    wanted.set_offset(wanted.offset() + content.size());
  }
  if (wanted.offset() > answer.size())
    throw Error("the answer became shorter while it was read; ask again");
}

std::string answer_bytes(const Ask& ask, const proto::AnswerReply& answer) {
  if (answer.size() > Answers::size_max) {  // It would have to be held in memory.
    throw Error(
        fmt::format("answer = {} bytes (must be at most {})", answer.size(), Answers::size_max));
  }
  std::string bytes;
  read_answer(ask, answer, [&](std::string_view part) { bytes += part; });
  Sha256 hash;
  hash.add_bytes(bytes);
  if (hash.finish() != answer.sha256())
    throw Error("the answer is not the one that was announced; ask again");
  return bytes;
}

int print_answer(const ClientConnectionConfig& connection, const proto::RequestEnvelope& question,
                 void (*print)(std::string_view)) {
  const Ask ask = connected({.connection = connection});
  const proto::ReplyEnvelope reply = reply_of(ask, question, proto::ReplyEnvelope::kAnswer);
  const proto::AnswerReply& answer = reply.answer();
  print(answer_bytes(ask, answer));
  flush_standard_output();
  if (!answer.error_text().empty()) wire::say(wire::visible_lines(answer.error_text()));
  return static_cast<int>(answer.exit_code());
}

namespace {

using proto::CampaignStatus;

void add_further(std::uint64_t count, int num_shown, std::string_view thing,
                 std::vector<Remark>& remarks) {
  const std::string note = further_note(count, num_shown, thing);
  if (!note.empty()) remarks.push_back({note});
}

Table campaigns_table(const proto::StatusReply& status) {
  Table table;
  if (status.campaigns().empty()) table.remarks.push_back({"no campaigns"});
  if (!status.campaigns().empty()) table.columns = campaign_columns();
  for (const CampaignStatus& campaign : status.campaigns()) {
    table.rows.push_back(campaign_row(campaign));
    for (Remark note : notes_about(campaign)) {
      note.text = fmt::format("{}: {}", campaign.name(), note.text);
      table.remarks.push_back(std::move(note));
    }
  }
  add_further(status.num_campaigns(), status.campaigns_size(), "more campaign", table.remarks);
  for (Remark& note : service_notes(status)) table.remarks.push_back(std::move(note));
  return table;
}

std::string service_lines(const proto::StatusReply& status, std::size_t line_width_max) {
  std::uint64_t num_lent = 0;
  std::set<std::string> versions;
  for (const CampaignStatus& campaign : status.campaigns()) {
    num_lent += campaign.num_lent();
    versions.insert(campaign.model_version());
  }
  const std::string workers =
      fmt::format("{} with {}, {} lent", counted(status.num_workers(), "worker"),
                  counted(status.num_slots(), "slot"), counted(num_lent, "run"));
  return fmt::format("{}\n{}\n\n",
                     shortened(wire::visible_text(service_line(status, versions)), line_width_max),
                     shortened(workers, line_width_max));
}

/// Seven characters at most.
std::string count_cell(std::uint64_t count) {
  constexpr std::uint64_t digits_max = 10'000'000;
  return count < digits_max ? std::to_string(count) : measured_figure(static_cast<double>(count));
}

/// In the largest unit: `3 s`, `12 min`, `3 h`, `4 d`.
std::string ago(double seconds) {
  constexpr double longest_s = 9999.0 * 86400.0;
  const auto total = static_cast<std::uint64_t>(std::clamp(seconds, 0.0, longest_s));
  if (total < 60) return fmt::format("{} s", total);
  if (total < 3600) return fmt::format("{} min", total / 60);
  if (total < 86400) return fmt::format("{} h", total / 3600);
  return fmt::format("{} d", total / 86400);
}

}  // namespace

std::string status_text(const proto::StatusReply& status, const TerminalStyle& style) {
  return service_lines(status, style.line_width_max) +
         terminal_text(campaigns_table(status), style);
}

namespace {

/// `7: 1 NVIDIA H100 80GB HBM3 (CUDA 13.0), 2050 runs/s`.
std::string cards_line(const proto::WorkerStatus& worker) {
  std::string line = fmt::format("{}: {}", worker.worker_id(), worker.cards());
  if (worker.card_rate_hz() > 0.0)
    line += fmt::format(", {} runs/s", measured_figure(worker.card_rate_hz()));
  return line;
}

}  // namespace

Table workers_table(const proto::WorkersReply& workers) {
  if (workers.workers().empty()) return {.remarks = {{"no workers"}}};
  Table table{.columns = {{"id", false, 8},
                          {"  worker", true, 17},
                          {"host", true, 14},
                          {"pid", false, 8},
                          {"slots", false, 6},
                          {"lent", false, 8},
                          {"results", false, 9},
                          {"heard", false, 9}}};
  for (const proto::WorkerStatus& worker : workers.workers()) {
    table.rows.push_back({count_cell(worker.worker_id()), "  " + worker.name(), worker.host(),
                          count_cell(worker.process_id()), count_cell(worker.num_slots()),
                          count_cell(worker.num_lent()), count_cell(worker.num_results()),
                          ago(worker.silent_s())});
    if (!worker.cards().empty()) table.remarks.push_back({cards_line(worker)});
    if (!worker.is_quarantined()) continue;
    table.remarks.push_back(
        {fmt::format("{}: in quarantine, is lent nothing more: too many crashes on {}",
                     worker.worker_id(), worker.host()),
         Tone::bad});
  }
  add_further(workers.num_workers(), workers.workers_size(), "more worker", table.remarks);
  return table;
}

std::string campaign_line(const CampaignStatus& campaign) {
  std::string text =
      fmt::format("{} {}: {} of {}, {} %", campaign.name(), wire::phase_name(campaign),
                  campaign.num_done(), counted(campaign.num_runs(), "run"), percent_done(campaign));
  if (!is_over(campaign)) {
    if (campaign.rate_hz() > 0.0) text += fmt::format(", {} runs/s", rate_text(campaign));
    if (campaign.has_remaining_s()) text += fmt::format(", {} left", time_left_text(campaign));
  }
  for (const Remark& note : notes_about(campaign)) text += "; " + note.text;
  return text;
}

void print_done(const Ask& ask, const proto::RequestEnvelope& request, const ActionTaken& action,
                OutputFormat format) {
  const std::string text = reply_of(ask, request, proto::ReplyEnvelope::kDone).done().text();
  if (format == OutputFormat::text) return print_lines(text + "\n");
  print_json({{"action", action.name}, {std::string(action.kind), action.target}, {"text", text}});
}

}  // namespace proofmass::coordinator
