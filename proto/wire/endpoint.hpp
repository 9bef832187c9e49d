#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass::wire {

enum class EndpointUse : std::uint8_t { bind, connect };

/// What keeps strangers away from an address.
enum class Protection : std::uint8_t {
  none,    ///< Nothing: only this machine may reach it.
  keys,    ///< Both ends prove who they are, and all is encrypted.
  waived,  ///< Nothing, and the user knows it: --insecure-plain.
};

/// Accepts the addresses at which a coordinator can meet its workers and clients:
///
///     ipc://PATH  tcp://127.0.0.1:PORT  tcp://[::1]:PORT           anyhow
///     tcp://HOST:PORT  tcp://[IPV6]:PORT                           with keys, or waived
///     tcp://*:PORT  tcp://INTERFACE:PORT                           to bind; with keys, or waived
///
/// A port to bind may be `*`: the system chooses one.
///
/// @param option  Name of the option that the endpoint comes from, for the message.
/// @throws InvalidArgument reading `option = endpoint (rule)`.
void check_endpoint(std::string_view option, const std::string& endpoint, EndpointUse use,
                    Protection protection);

/// True if no other machine can reach the address.
///
/// @param endpoint  check_endpoint() holds.
[[nodiscard]] bool is_local(const std::string& endpoint);

/// True if the address may turn out to be one of IPv6.
///
/// @param endpoint  check_endpoint() holds.
[[nodiscard]] bool may_be_ipv6(const std::string& endpoint, EndpointUse use);

}  // namespace proofmass::wire
