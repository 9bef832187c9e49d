#include "coordinator/net/authentication/refusal_log.hpp"

#include <zmq.h>

#include <cerrno>
#include <cstdint>
#include <string_view>
#include <utility>

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::minutes period(1);
constexpr std::size_t lines_per_period_max = 20;

/// ZeroMQ writes an IPv4 address in the form of IPv6 if its socket has both.
std::string_view plain(std::string_view address) {
  constexpr std::string_view mapped = "::ffff:";
  const bool is_mapped = address.starts_with(mapped) && address.find('.') != std::string_view::npos;
  return is_mapped ? address.substr(mapped.size()) : address;
}

std::string_view or_else(std::string_view text, std::string_view substitute) {
  return text.empty() ? substitute : text;
}

std::string_view protocol_reason(std::uint32_t error) {
  switch (error) {
    case ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
      return "without a key";
    case ZMQ_PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC:
    case ZMQ_PROTOCOL_ERROR_ZMTP_KEY_EXCHANGE:
      return "trusts the key of another coordinator";
    default:
      return "breaks the rules of the handshake";
  }
}

}  // namespace

RefusalLog::RefusalLog(Log log) : log_(std::move(log)) {}

void RefusalLog::refused(const Refusal& refusal, TimePoint now) {
  if (lines_.empty() || now - began_at_ >= period) begin_minute(now);
  Event event{.severity = Severity::warning,
              .kind = "peer_refused",
              .fields = {{"domain", or_else(refusal.domain, "none")},
                         {"address", or_else(plain(refusal.address), "unknown")},
                         {"key", or_else(refusal.public_key, "none")},
                         Field::reason(refusal.reason)}};
  std::string line = to_text(event);
  if (lines_.contains(line)) return;
  if (lines_.size() >= lines_per_period_max) {
    ++num_left_out_;
    return;
  }
  lines_.insert(std::move(line));
  log_(std::move(event));
}

void RefusalLog::begin_minute(TimePoint now) {
  if (num_left_out_ > 0) {
    log_({.severity = Severity::warning,
          .kind = "peers_refused",
          .fields = {{"count", num_left_out_}, Field::remark("without a line each")}});
  }
  num_left_out_ = 0;
  lines_.clear();
  began_at_ = now;
}

const int failed_handshakes =
    ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;

// Which end of a handshake without keys notices first is a matter of chance, so the coordinator
// sometimes sees no more than the end.
std::string_view reason_of(const wire::SocketEvent& event) {
  if (event.kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL) return protocol_reason(event.value);
  return event.value == EAGAIN ? "handshake takes too long"
                               : "leaves during the handshake: it ended, or has no key";
}

}  // namespace proofmass::coordinator
