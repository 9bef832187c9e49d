#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/link/keys.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::worker {

/// A worker's connection to its coordinator, made again whenever it is lost. What is sent without
/// one, or faster than the network takes it, is lost.
class CoordinatorLink {
 public:
  /// Begins to connect.
  ///
  /// @param endpoint  wire::check_endpoint() holds.
  /// @throws Error if the socket cannot be made.
  CoordinatorLink(const std::string& endpoint, const wire::ClientSecurity& security);
  ~CoordinatorLink();  ///< Waits some seconds at most until what was sent has left.
  CoordinatorLink(const CoordinatorLink&) = delete;
  CoordinatorLink& operator=(const CoordinatorLink&) = delete;

  /// Whether messages come late on purpose.
  [[nodiscard]] bool has_faults() const;

  /// Leaves the connection, with what has not been sent, and makes another one.
  void reconnect();

  /// Waits until there is something to receive or one of the descriptors is readable, at most for
  /// this time.
  void wait(std::span<const int> descriptors, Duration time_max);

  void send(std::string bytes, TimePoint now);
  /// Hands the messages that have come to `handle`, until it returns false.
  void receive(TimePoint now, const std::function<bool(std::string_view)>& handle);

  /// True if a connection was made since the last call.
  [[nodiscard]] bool take_connected();
  /// Why the coordinator does not let this worker in, once for each reason.
  [[nodiscard]] std::optional<std::string> take_refusal();

 private:
  struct Connection;
  void connect();
  void transmit_due(TimePoint now);
  void transmit(const std::string& bytes);

  std::string endpoint_;
  wire::ClientSecurity security_;
  std::unique_ptr<Connection> connection_;
};

}  // namespace proofmass::worker
