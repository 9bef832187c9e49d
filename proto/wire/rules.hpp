#pragma once

namespace google::protobuf {
class Descriptor;
class Message;
}  // namespace google::protobuf

namespace proofmass::wire::detail {

/// Whether a message, and those in it, are what a peer may send: numbers and sizes are within their
/// limits, enumerators are known, names are names, lists have as many entries as others say.
/// @throws ConfigError reading `field = value (rule)`.
void check_rules(const google::protobuf::Message& message);

/// What must hold between fields that obey their own rules; null if nothing must.
[[nodiscard]] auto related_rules_of(const google::protobuf::Descriptor& type)
    -> void (*)(const google::protobuf::Message&);

/// Makes each text of a message, and of those in it, one that may be sent: a name a name, what goes
/// to a terminal no longer than that may be and printable. A number that is not finite or negative
/// becomes 0. Fields of bytes stay as they are.
void make_sendable(google::protobuf::Message& message);

}  // namespace proofmass::wire::detail
