#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/net/client_connection.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Arguments of every command that asks a coordinator.
struct ClientOptions {
  ClientConnectionConfig connection;
  OutputFormat format = OutputFormat::text;
};

/// Declares --connect, --keys, --insecure-plain, --timeout and --json.
/// @param options  Lives as long as the command.
void add_client_options(CLI::App& command, ClientOptions& options);

/// Warns on standard error if what is said goes unprotected beyond this machine.
void warn_if_plain(const ClientOptions& options);

/// How a command asks; a ClientConnection, or a test.
using Ask = std::function<proto::ReplyEnvelope(const proto::RequestEnvelope&)>;

/// The reply, which is of this kind.
/// @throws Error with the coordinator's words if it refuses the request.
[[nodiscard]] proto::ReplyEnvelope reply_of(const Ask& ask, const proto::RequestEnvelope& request,
                                            proto::ReplyEnvelope::ReplyCase kind);

/// Connects, and lets `work` ask.
/// @return What `work` returns.
/// @throws What ClientConnection and `work` throw.
[[nodiscard]] int with_connection(const ClientOptions& options,
                                  const std::function<int(const Ask&)>& work);

/// All campaigns, which a coordinator tells in several replies if they are too many for one.
/// @throws Error if the coordinator refuses.
[[nodiscard]] proto::StatusReply whole_status(const Ask& ask);

/// All workers, asked for page by page.
/// @throws Error if the coordinator refuses.
[[nodiscard]] proto::WorkersReply all_workers(const Ask& ask);

/// The name. @throws UsageError unless a campaign may have it.
[[nodiscard]] std::string checked_campaign_name(const std::string& name);

// Questions about results that a coordinator answers.

/// Declares --connect, --keys and --insecure-plain for a command that reads a database by itself
/// unless --connect names a coordinator. That option has no environment variable, since it changes
/// what the command's first argument means.
/// @param connection  Lives as long as the command.
void add_optional_connection(CLI::App& command, ClientConnectionConfig& connection);

/// Whether a coordinator is to be asked about a campaign of this name.
/// @throws Error if it is not, and no file has the name either.
[[nodiscard]] bool is_remote(const ClientConnectionConfig& connection,
                             const std::filesystem::path& database);

/// An AnswerRequest, without options.
/// @throws UsageError unless a campaign may have this name.
[[nodiscard]] proto::RequestEnvelope question_about(const std::string& campaign,
                                                    proto::Question question);

/// Reads an answer from its offset on, part by part, and asks for nothing beyond its size.
/// @param take  Called with each part.
/// @throws Error if the coordinator does not keep it any more; what `take` throws.
void read_answer(const Ask& ask, const proto::AnswerReply& answer,
                 const std::function<void(std::string_view)>& take);

/// The whole answer.
/// @throws As read_answer() does; Error if it is too large or arrived damaged.
[[nodiscard]] std::string answer_bytes(const Ask& ask, const proto::AnswerReply& answer);

/// How the answer to a question is printed.
enum class AnswerText : std::uint8_t {
  lines,  ///< By print_lines().
  bytes,  ///< Every byte unchanged.
};

/// Asks a coordinator and prints what its command writes, to standard output and standard error.
/// @return The exit code of that command.
/// @throws As reply_of() and with_connection() do; Error if the answer arrived damaged.
[[nodiscard]] int print_answer(const ClientConnectionConfig& connection,
                               const proto::RequestEnvelope& question, AnswerText text);

// What a coordinator replied.

/// Two lines about the coordinator, a row a campaign, and lines about what is out of the ordinary.
[[nodiscard]] std::string status_text(const proto::StatusReply& status, const TerminalStyle& style);

/// A row a worker, and lines about those that are lent nothing.
[[nodiscard]] Table workers_table(const proto::WorkersReply& workers);

/// `mine active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const proto::CampaignStatus& campaign);

/// What a client asked for.
struct ActionTaken {
  std::string_view name;    ///< `pause`, `submit`.
  std::string_view kind;    ///< Of its target: `campaign`, `host`.
  std::string_view target;  ///< Name.
};

/// Asks for it, and prints the coordinator's words, or an object with them: {"action": name, kind:
/// target, "text": words}.
/// @throws As reply_of().
void print_done(const Ask& ask, const proto::RequestEnvelope& request, const ActionTaken& action,
                OutputFormat format);

}  // namespace proofmass::coordinator
