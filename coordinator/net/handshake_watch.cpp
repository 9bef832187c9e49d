#include "coordinator/net/handshake_watch.hpp"

#include <zmq.h>

#include <cerrno>
#include <cstdint>
#include <string_view>

namespace proofmass::coordinator {
namespace {

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

/// Which end of a handshake without keys notices first is a matter of chance, so the coordinator
/// sometimes sees no more than the end.
std::string_view reason_of(const wire::SocketEvent& event) {
  if (event.kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL) return protocol_reason(event.value);
  return event.value == EAGAIN ? "handshake takes too long"
                               : "ends during the handshake, as one without a key does";
}

}  // namespace

const int failed_handshakes =
    ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;

void HandshakeWatch::update(TimePoint now) {
  while (const auto event = next_event_()) {
    if ((event->kind & failed_handshakes) == 0) continue;
    log_.refused(
        {.domain = to_text(domain_), .address = {}, .public_key = {}, .reason = reason_of(*event)},
        now);
  }
}

}  // namespace proofmass::coordinator
