#include <fmt/format.h>

#include "core/error.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/message_reader.hpp"

namespace proofmass::wire {
namespace {

/// The largest batch of results has 40,000.
constexpr std::size_t fields_max = 65536;

DecodeError too_large(std::size_t size, std::size_t size_max) {
  return {DecodeFault::too_large,
          fmt::format("message size = {} bytes (must be at most {})", size, size_max)};
}

DecodeError wrong_version(std::uint32_t version) {
  return {DecodeFault::wrong_version,
          fmt::format("protocol_version = {} (must be {})", version, protocol_version)};
}

Packet read_packet(const proto::Envelope& envelope) {
  return {.header = {.session = {detail::checked_id(envelope.session(), "session")},
                     .epoch = {envelope.epoch()},
                     .sequence = envelope.sequence()},
          .message = detail::read_message(envelope)};
}

}  // namespace

std::variant<Packet, DecodeError> decode(std::string_view bytes) {
  detail::silence_protobuf();
  if (bytes.size() > message_size_max) return too_large(bytes.size(), message_size_max);
  proto::Envelope envelope;
  const bool is_parsed =
      detail::has_fields_at_most(bytes, *proto::Envelope::descriptor(), fields_max) &&
      envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!is_parsed) {
    return DecodeError{DecodeFault::unparsable,
                       fmt::format("message = {} bytes (must be an envelope of at most {} fields)",
                                   bytes.size(), fields_max)};
  }
  if (envelope.protocol_version() != protocol_version) {
    return wrong_version(envelope.protocol_version());
  }
  if (envelope.message_case() == proto::Envelope::MESSAGE_NOT_SET) {
    return DecodeError{DecodeFault::empty, "message = none (must be of a known kind)"};
  }
  try {
    return read_packet(envelope);
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, detail::printable(error.what())};
  }
}

}  // namespace proofmass::wire
