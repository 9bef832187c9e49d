#pragma once

#include <functional>
#include <string>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/net/client_connection.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Arguments of every command that asks a coordinator.
struct ClientOptions {
  ClientConnectionConfig connection;
  OutputFormat format = OutputFormat::text;
};

/// Declares --keys and --insecure-plain.
/// @param connection  Lives as long as the command.
void add_key_options(CLI::App& command, ClientConnectionConfig& connection);

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
[[nodiscard]] wire::StatusReply whole_status(const Ask& ask);

/// All workers, asked for page by page.
/// @throws Error if the coordinator refuses.
[[nodiscard]] wire::WorkersReply all_workers(const Ask& ask);

/// The name. @throws UsageError unless a campaign may have it.
[[nodiscard]] std::string checked_campaign_name(const std::string& name);

}  // namespace proofmass::coordinator
