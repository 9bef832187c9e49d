#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

struct ClientConnectionConfig {
  std::string endpoint;                       ///< Where the coordinator serves clients.
  std::optional<std::filesystem::path> keys;  ///< With client.key and coordinator.pub.
  bool is_plain_waived = false;               ///< No keys beyond this machine: the user knows it.
  std::chrono::duration<double> reply_wait =
      std::chrono::seconds(10);  ///< For a sign of life; > 0.
};

/// A client's connection to a coordinator: one request at a time.
class ClientConnection {
 public:
  /// Connects in the background.
  ///
  /// @throws InvalidArgument reading `connect = endpoint (rule)`; Error if keys cannot be read.
  explicit ClientConnection(const ClientConnectionConfig& config);
  ~ClientConnection();

  /// Sends a request with a number of its own, a large one in parts, and waits for its reply, as
  /// long as the coordinator says that it is at work. The request is sent again when the connection
  /// was lost meanwhile, so the coordinator may carry it out twice; each leads to the same end as
  /// once.
  ///
  /// Refused connections end the wait at once if there was never a successful one. Otherwise the
  /// coordinator may be starting again, and a refusal is only the reason if time runs out.
  ///
  /// @return The reply, which may be that the request is refused.
  /// @throws Error reading `connect = endpoint (reason)` if nobody is there, the coordinator lets
  ///         this client not in, or it does not answer in time or in the same words;
  ///         InvalidArgument if the request is too large.
  [[nodiscard]] proto::ReplyEnvelope ask(proto::RequestEnvelope request);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
