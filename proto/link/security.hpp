#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "proto/link/key_files.hpp"

namespace proofmass::wire {

/// The two doors of a coordinator. Each has its own list of keys: a worker may not submit, a client
/// may not deliver results.
enum class Domain : std::uint8_t { workers, clients };

[[nodiscard]] std::string_view to_text(Domain domain);  ///< `workers`, `clients`.

/// How a coordinator's socket proves who it is. With keys, only peers that an Authenticator in the
/// same context admits to the domain get in; without, everybody who reaches the address.
struct ServerSecurity {
  Domain domain = Domain::workers;
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

/// Reads DIRECTORY/coordinator.key.
/// @throws Error as read_key_pair() does.
[[nodiscard]] ServerSecurity read_server_security(const std::filesystem::path& directory,
                                                  Domain domain);

/// Reads DIRECTORY/worker.key or client.key, and coordinator.pub.
///
/// @param role  Worker or client.
/// @throws Error as read_key_pair() and read_public_key() do.
[[nodiscard]] ClientSecurity read_client_security(const std::filesystem::path& directory,
                                                  KeyRole role);

}  // namespace proofmass::wire
