#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/net/client_connection.hpp"
#include "coordinator/table/table.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Arguments of every command that asks a coordinator.
struct ClientOptions {
  ClientConnectionConfig connection;
  OutputFormat format = OutputFormat::text;
};

/// Declares --connect, --keys, --insecure-plain, --timeout and --json.
void add_client_options(CLI::App& command, ClientOptions& options);

/// Warns on standard error if what is said goes unprotected beyond this machine.
void warn_if_plain(const ClientOptions& options);

/// How a command asks; a ClientConnection, or a test.
using Ask = std::function<proto::ReplyEnvelope(const proto::RequestEnvelope&)>;

/// The reply, which is of this kind.
/// @throws Error with the coordinator's words if it refuses the request.
[[nodiscard]] proto::ReplyEnvelope reply_of(const Ask& ask, const proto::RequestEnvelope& request,
                                            proto::ReplyEnvelope::ReplyCase kind);

/// Connects in the background.
/// @throws What ClientConnection throws.
[[nodiscard]] Ask connected(const ClientOptions& options);

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

/// Asks a coordinator and prints what its command writes, to standard output and standard error.
/// @param print  Gets what is for standard output: print_lines(), or write_standard_output() for
///               every byte unchanged.
/// @return The exit code of that command.
/// @throws As reply_of() and connected() do; Error if the answer arrived damaged.
[[nodiscard]] int print_answer(const ClientConnectionConfig& connection,
                               const proto::RequestEnvelope& question,
                               void (*print)(std::string_view) = print_lines);

// What a coordinator replied.

/// Two lines about the coordinator, a row a campaign, and lines about what is out of the ordinary.
[[nodiscard]] std::string status_text(const proto::StatusReply& status, const TerminalStyle& style);

/// A row a worker, and lines about those that are lent nothing.
[[nodiscard]] Table workers_table(const proto::WorkersReply& workers);

/// `mine active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const proto::CampaignStatus& campaign);

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

enum class WatchMode : std::uint8_t {
  screen,  ///< The table of `status`, drawn again in its place: for a terminal.
  lines,   ///< A line when a campaign has advanced by ten percent, or something happened.
  json,    ///< An object a line, each time.
};

/// A text and what makes it take the place of the one drawn before.
struct Drawing {
  std::string text;
  std::size_t num_lines = 0;  ///< Of the table that is on the screen.
};

/// Draws a terminal_text() over `num_lines_before` lines that end right above the cursor. What is
/// wider than the screen is cut. If there are more lines than the screen has rows, the last one
/// says how many are left out.
[[nodiscard]] Drawing drawn_over(std::size_t num_lines_before, std::string_view text,
                                 const ScreenSize& screen);

/// Shows where campaigns stand, again and again.
class WatchDisplay {
 public:
  /// @param stream  Must outlive this object.
  WatchDisplay(WatchMode mode, std::FILE* stream);

  void update(const proto::StatusReply& status);

 private:
  void show_screen(const proto::StatusReply& status);
  void show_lines(const proto::StatusReply& status);

  WatchMode mode_;
  std::FILE* stream_;
  std::size_t num_lines_drawn_ = 0;
  std::map<std::string, std::string> shown_;  ///< By campaign: what the last line was about.
};

/// Asks and shows where the campaign stands, or all do, until they are finished or cancelled.
///
/// @param campaign  By default all.
/// @param pause     Called between one question and the next.
/// @return exit_done, or exit_cannot_be_done if one of them was cancelled or has failed.
/// @throws Error naming the campaigns that there are, if there is no such one; as reply_of() does.
[[nodiscard]] int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                                   WatchDisplay& display, const std::function<void()>& pause);

/// watch_until_over() with a WatchDisplay on standard output, each second.
/// @return Also exit_not_met, if the campaign that is named has missed its stop rule.
[[nodiscard]] int watch_on_standard_output(const Ask& ask,
                                           const std::optional<std::string>& campaign,
                                           OutputFormat format);

}  // namespace proofmass::coordinator
