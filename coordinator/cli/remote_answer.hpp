#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/cli/client.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// Declares --connect, --keys and --insecure-plain for a command that reads a database by itself
/// unless --connect names a coordinator. That option has no environment variable, since it changes
/// what the command's first argument means.
/// @param connection  Lives as long as the command.
void add_optional_connection(CLI::App& command, ClientConnectionConfig& connection);

/// True if the coordinator is to be asked.
[[nodiscard]] inline bool is_remote(const ClientConnectionConfig& connection) {
  return !connection.endpoint.empty();
}

/// An AnswerRequest, without options.
/// @throws UsageError unless a campaign may have this name.
[[nodiscard]] proto::RequestEnvelope question_about(const std::string& campaign,
                                                    proto::Question question);

/// Reads an answer from its offset on, part by part, and asks for nothing beyond its size.
/// @param take  Called with each part.
/// @throws Error if the coordinator does not keep it any more; what `take` throws.
void read_answer(const Ask& ask, const proto::AnswerReply& answer,
                 const std::function<void(std::string_view)>& take);

/// How the answer to a question is printed.
enum class AnswerText : std::uint8_t {
  lines,  ///< As print_lines() does.
  bytes,  ///< As it is.
};

/// Asks a coordinator and prints what its command writes, to standard output and standard error.
/// @return The exit code of that command.
/// @throws As reply_of() and with_connection() do; Error if the answer arrived damaged.
[[nodiscard]] int print_answer(const ClientConnectionConfig& connection,
                               const proto::RequestEnvelope& question, AnswerText text);

}  // namespace proofmass::coordinator
