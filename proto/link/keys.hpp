#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "proto/wire/endpoint.hpp"

namespace proofmass::wire {

/// Whom a pair of keys stands for.
enum class KeyRole : std::uint8_t { coordinator, worker, client };

[[nodiscard]] std::string_view to_text(KeyRole role);  ///< `coordinator`, `worker`, `client`.

/// The public half of a pair, which anybody may know: Curve25519 in ZeroMQ's Z85 form, 40 printable
/// characters. The first is never `#`, as that would be more than 32 bits: a list of keys can have
/// comments.
class PublicKey {
 public:
  /// Nothing if the text is not such a key.
  [[nodiscard]] static std::optional<PublicKey> parse(std::string_view text);

  [[nodiscard]] const std::string& text() const { return text_; }

  auto operator<=>(const PublicKey&) const = default;

 private:
  explicit PublicKey(std::string_view text) : text_(text) {}

  std::string text_;
};

/// The secret half of a pair. It cannot be printed by accident: only reveal() gives its text.
class SecretKey {
 public:
  [[nodiscard]] static std::optional<SecretKey> parse(std::string_view text);

  /// For a socket and for a key file; not for a log, an error or another process.
  [[nodiscard]] const std::string& reveal() const { return text_; }

 private:
  explicit SecretKey(std::string_view text) : text_(text) {}

  std::string text_;
};

struct KeyPair {
  PublicKey public_key;
  SecretKey secret_key;
};

/// A new pair, from the system's random numbers.
[[nodiscard]] KeyPair make_key_pair();

/// Writes a pair to two new files: `NAME.key` with both halves, for this user alone, and `NAME.pub`
/// with the public one. Either file is whole or not there, also after a crash.
///
/// @param directory  Exists.
/// @throws Error reading `key file = PATH (rule)` if one of them exists or cannot be written, or if
///         the file system would let others read the secret.
void write_key_pair(const std::filesystem::path& directory, std::string_view name, KeyRole role,
                    const KeyPair& pair);

/// Reads `NAME.key`.
///
/// @param role  Whose key it must be.
/// @throws Error reading `key file = PATH (rule)` if it cannot be read, is somebody else's, can be
///         read by others than its owner, or holds no pair of that role. No message has a secret.
[[nodiscard]] KeyPair read_key_pair(const std::filesystem::path& file, KeyRole role);

/// Reads `NAME.pub`.
/// @throws Error as read_key_pair() does; others may read it, and it may be root's.
[[nodiscard]] PublicKey read_public_key(const std::filesystem::path& file, KeyRole role);

// How sockets use keys.

/// How an address of a coordinator is called, `workers` or `clients`, by who may connect there.
/// Each has its own list of keys: a worker may not submit, a client may not deliver results.
[[nodiscard]] std::string domain_of(KeyRole role);
/// The file of that list in a directory of keys: `authorized_workers`.
[[nodiscard]] std::string list_name(KeyRole role);

/// How a coordinator's socket proves who it is. With keys, only peers that an Authenticator in the
/// same context admits to the domain get in; without, everybody who reaches the address.
struct ServerSecurity {
  KeyRole peers = KeyRole::worker;
  std::optional<KeyPair> keys;
};

/// The keys of a worker or client, and the coordinator that it trusts.
struct CurveIdentity {
  KeyRole role = KeyRole::worker;  ///< Worker or client.
  KeyPair keys;
  PublicKey coordinator;
};

/// How a worker's or client's socket proves who it is; without an identity it says all in the
/// clear.
struct ClientSecurity {
  std::optional<CurveIdentity> identity;
};

/// What keeps strangers away from an address, with or without a directory of keys.
/// @param is_plain_waived  The option --insecure-plain.
[[nodiscard]] Protection protection_by(const std::optional<std::filesystem::path>& keys,
                                       bool is_plain_waived);

/// A user who may write to a directory of keys decides who may do what.
/// @throws Error reading `key directory = PATH (rule)` if others than this user and root can.
void check_key_directory(const std::filesystem::path& directory);

/// Reads DIRECTORY/coordinator.key.
/// @throws Error as check_key_directory() and read_key_pair() do.
[[nodiscard]] ServerSecurity read_server_security(const std::filesystem::path& directory,
                                                  KeyRole peers);

/// Reads DIRECTORY/worker.key or client.key, and coordinator.pub.
///
/// @param role  Worker or client.
/// @throws Error as check_key_directory(), read_key_pair() and read_public_key() do.
[[nodiscard]] ClientSecurity read_client_security(const std::filesystem::path& directory,
                                                  KeyRole role);

}  // namespace proofmass::wire
