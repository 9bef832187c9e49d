#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "proto/wire/client_messages.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::wire {

// What clients and coordinator exchange, as bytes. An envelope holds protocol_version, the number
// of a request and its content; the reply repeats the number.

/// Size limits, bytes. A SubmitRequest may be as large as the first, any other as the second.
inline constexpr std::size_t submit_size_max = std::size_t{64} << 20;
inline constexpr std::size_t request_size_max = std::size_t{64} << 10;
inline constexpr std::size_t reply_size_max = std::size_t{4} << 20;
/// Of one message: a larger request travels as RequestParts with slices of at most the first.
inline constexpr std::size_t request_part_size_max = std::size_t{256} << 10;
inline constexpr std::size_t request_message_size_max = request_part_size_max + 1024;

inline constexpr std::size_t campaigns_per_reply_max = 512;
inline constexpr std::size_t workers_per_reply_max = 4096;
inline constexpr std::size_t unserved_files_per_reply_max = 64;
inline constexpr std::size_t quarantined_hosts_per_reply_max = 256;
inline constexpr std::size_t factories_max = 64;  ///< That a coordinator knows and a reply names.
inline constexpr std::uint64_t factory_interval_s_max = 3600;
inline constexpr std::size_t reply_text_size_max = 4096;  ///< Of any text in a reply, bytes.
inline constexpr std::size_t stop_rule_size_max = 200;    ///< Bytes.
inline constexpr int priority_max = 100;                  ///< The least is -priority_max.
inline constexpr std::size_t answer_options_max = 64;
inline constexpr std::size_t answer_option_size_max = 4096;               ///< Bytes.
inline constexpr std::size_t statement_size_max = std::size_t{32} << 10;  ///< Bytes.
inline constexpr std::size_t answer_part_size_max = std::size_t{1} << 20;

/// A request as it travels.
struct RequestPacket {
  std::uint64_t id = 0;  ///< Chosen by the client; not 0.
  ClientRequest request;
};

/// A reply as it travels.
struct ReplyPacket {
  std::uint64_t id = 0;  ///< Of the request; 0 if that could not be decoded.
  ClientReply reply;
};

/// The bytes of a request or reply. Texts of a reply or report are cut to reply_text_size_max; what
/// is not printable ASCII or the end of a line becomes `?` in them, since they go to terminals.
/// @throws InvalidArgument if they are more than the message may have.
[[nodiscard]] std::string encode(const RequestPacket& packet);
[[nodiscard]] std::string encode(const ReplyPacket& packet);

/// Checks everything, like decode(): what they return needs no further check of form. What the
/// definition of a SubmitRequest says is not looked at.
///
/// @param bytes  Anything at all, from anybody.
[[nodiscard]] std::variant<RequestPacket, DecodeError> decode_request(std::string_view bytes);
[[nodiscard]] std::variant<ReplyPacket, DecodeError> decode_reply(std::string_view bytes);

}  // namespace proofmass::wire
