#include "coordinator/net/client_connection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <string_view>
#include <utility>
#include <variant>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

wire::ClientSecurity security_of(const ClientConnectionConfig& config) {
  wire::check_endpoint("connect", config.endpoint, wire::EndpointUse::connect,
                       wire::protection_by(config.keys, config.is_plain_waived));
  if (!config.keys) return {};
  return wire::read_client_security(*config.keys, wire::KeyRole::client);
}

}  // namespace

class ClientConnection::Impl {
 public:
  explicit Impl(const ClientConnectionConfig& config)
      : config_(config),
        security_(security_of(config)),
        dealer_(wire::make_dealer(context_, security_, wire::KeyRole::client)),
        monitor_(context_, dealer_, config.endpoint, security_, Clock::now()) {}

  proto::ReplyEnvelope ask(proto::RequestEnvelope request) {
    request.set_request_id(++request_id_);
    request_ = wire::encode(std::move(request));
    offset_ = 0;
    is_sent_ = false;
    hear();
    for (;;) {
      check_admission();
      is_sent_ = monitor_.is_connected() && (is_sent_ || send(next_message()));
      while (auto reply = receive()) {
        if (!is_interim(*reply)) return *std::move(reply);
      }
      const auto left = std::chrono::ceil<milliseconds>(deadline_ - Clock::now());
      if (left <= milliseconds(0)) fail_late();
      wait(std::min(left, is_sent_ || !monitor_.is_connected() ? turn_max : send_pause));
    }
  }

 private:
  static constexpr milliseconds turn_max{500};
  static constexpr milliseconds send_pause{5};  ///< A connection is ready soon after it is there.

  /// The coordinator is there: from now on counts the time that it has for an answer.
  void hear() { deadline_ = Clock::now() + std::chrono::ceil<milliseconds>(config_.reply_wait); }

  /// The whole request, or the part of it that the coordinator wants.
  [[nodiscard]] std::string next_message() const {
    if (request_.size() <= wire::request_part_size_max) return request_;
    proto::RequestEnvelope message;
    message.set_request_id(request_id_);
    proto::RequestPart& part = *message.mutable_part();
    part.set_total_size(request_.size());
    part.set_offset(offset_);
    part.set_slice(request_.substr(offset_, wire::request_part_size_max));
    return wire::encode(std::move(message));
  }

  /// True if the reply to the request itself follows this one.
  [[nodiscard]] bool is_interim(const proto::ReplyEnvelope& reply) {
    if (!reply.has_part() && !reply.has_wait()) return false;
    hear();
    if (reply.has_part() && reply.part().next_offset() < request_.size()) {
      offset_ = reply.part().next_offset();
      is_sent_ = false;
    }
    return true;
  }

  [[noreturn]] void fail(std::string_view reason) const {
    throw Error(fmt::format("connect = {} ({})", config_.endpoint, reason));
  }

  [[noreturn]] void fail_late() const {
    const double waited_s = config_.reply_wait.count();
    if (monitor_.is_connected()) fail(fmt::format("no answer within {:.3g} s", waited_s));
    if (refusal_) throw Error(*refusal_);
    if (monitor_.is_unanswered()) {
      fail(
          fmt::format("accepts the connection and has not answered within {:.3g} s: stopped, "
                      "overloaded, or no coordinator",
                      waited_s));
    }
    const std::string reason = wire::reason_if_unknown(config_.endpoint);
    if (!reason.empty()) fail(reason);
    fail(fmt::format("nobody there; waited {:.3g} s", waited_s));
  }

  /// Before the first connection a refusal is a mistake in the options. After it, it may pass: a
  /// tunnel breaks connections off while the coordinator behind it starts again.
  void check_admission() {
    monitor_.update(Clock::now());
    if (monitor_.is_connected()) {
      was_admitted_ = true;
      refusal_.reset();
    }
    if (auto refusal = monitor_.take_refusal()) {
      if (!was_admitted_) throw Error(*refusal);
      refusal_ = std::move(refusal);
    }
  }

  bool send(const std::string& bytes) {
    return dealer_.send(zmq::buffer(bytes), zmq::send_flags::dontwait).has_value();
  }

  /// The reply to the last request, if it is there.
  std::optional<proto::ReplyEnvelope> receive() {
    zmq::message_t message;
    while (dealer_.recv(message, zmq::recv_flags::dontwait)) {
      auto decoded = wire::decode_reply(message.to_string_view());
      if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) fail_foreign(*error);
      auto& reply = std::get<proto::ReplyEnvelope>(decoded);
      // The answer to an earlier request may come after its time.
      const bool is_late = reply.request_id() != 0 && reply.request_id() < request_id_;
      if (is_late) continue;
      if (reply.request_id() > request_id_) fail("answers what was not asked");
      return std::move(reply);
    }
    return std::nullopt;
  }

  [[noreturn]] void fail_foreign(const wire::DecodeError& error) const {
    if (error.fault == wire::DecodeFault::wrong_version) {
      fail("the coordinator is of another version: " + error.text);
    }
    fail("is it the coordinator's address for clients? " + error.text);
  }

  void wait(milliseconds duration_max) {
    std::array<zmq::pollitem_t, 2> items{
        zmq::pollitem_t{dealer_.handle(), 0, ZMQ_POLLIN, 0},
        zmq::pollitem_t{monitor_.handle(), 0, ZMQ_POLLIN, 0},
    };
    try {
      zmq::poll(items, duration_max);
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) throw;
    }
  }

  ClientConnectionConfig config_;
  wire::ClientSecurity security_;
  zmq::context_t context_;
  zmq::socket_t dealer_;
  wire::ConnectionMonitor monitor_;
  bool was_admitted_ = false;           ///< By this coordinator, at some time.
  std::optional<std::string> refusal_;  ///< The last one since the last connection.
  std::uint64_t request_id_ = 0;
  std::string request_;       ///< The bytes of the last one.
  std::uint64_t offset_ = 0;  ///< Of the part to be sent, if it travels in parts.
  bool is_sent_ = false;      ///< On this connection: the request, or that part.
  Clock::time_point deadline_;
};

ClientConnection::ClientConnection(const ClientConnectionConfig& config) {
  constexpr int num_threads = 2;  // Both are ZeroMQ's.
  wire::require_threads(num_threads);
  impl_ = std::make_unique<Impl>(config);
}

ClientConnection::~ClientConnection() = default;

proto::ReplyEnvelope ClientConnection::ask(proto::RequestEnvelope request) {
  return impl_->ask(std::move(request));
}

}  // namespace proofmass::coordinator
