#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "core/campaign/definition.hpp"
#include "proto/client.pb.h"
#include "proto/wire/codec.hpp"

namespace proofmass::wire {

// What clients and coordinator exchange: the envelopes of client.proto, and their bytes. The limits
// below, which the comments of client.proto name, and the checks in client_codec.cpp
// define what a peer may send.

inline constexpr std::size_t submit_size_max = std::size_t{64} << 20;   ///< Of a submission, bytes.
inline constexpr std::size_t request_size_max = std::size_t{64} << 10;  ///< Of others, bytes.
inline constexpr std::size_t reply_size_max = std::size_t{4} << 20;     ///< Bytes.
/// A larger request travels as several messages, each a RequestPart with a slice of at most
/// request_part_size_max bytes.
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

/// Of a request with this content, bytes.
[[nodiscard]] std::size_t size_max_of(const proto::RequestEnvelope& request);

/// The bytes of a request or reply; they say this program's protocol_version. Texts of a reply and
/// of a factory's report are cut to reply_text_size_max; what is not printable ASCII or the end of
/// a line becomes `?` in them, since they go to terminals. Names become names, numbers that are not
/// finite or negative become 0, and counts of a campaign's runs that contradict each other are cut.
/// @throws InvalidArgument if they are more than the message may have.
[[nodiscard]] std::string encode(proto::RequestEnvelope request);
[[nodiscard]] std::string encode(proto::ReplyEnvelope reply);

/// Checks everything, like decode(): what they return needs no further check of form. What the text
/// of the definition of a SubmitRequest says is not looked at.
///
/// @param bytes  Anything at all, from anybody.
[[nodiscard]] std::variant<proto::RequestEnvelope, DecodeError> decode_request(
    std::string_view bytes);
[[nodiscard]] std::variant<proto::ReplyEnvelope, DecodeError> decode_reply(std::string_view bytes);

/// `request` has no definition before.
void set_definition(const Definition& definition, proto::SubmitRequest& request);
/// The definition, which the request does not have any more. @pre The request has been checked.
[[nodiscard]] Definition take_definition(proto::SubmitRequest& request);

/// The request was carried out; for people: `campaign mine: 100 runs, 0 of them done`.
[[nodiscard]] proto::ReplyEnvelope done_reply(std::string text);
/// The request was refused: `field = value (rule)`.
[[nodiscard]] proto::ReplyEnvelope error_reply(std::string text);

}  // namespace proofmass::wire
