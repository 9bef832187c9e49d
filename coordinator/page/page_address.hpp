#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// Where a live page is served if no address is given.
inline constexpr std::string_view page_address_by_default = "127.0.0.1:5557";

/// Where a live page is served.
struct PageAddress {
  std::string host = "127.0.0.1";  ///< Address of an interface, IPv4 or IPv6 (without brackets).
  std::uint16_t port = 5557;       ///< 0: the system chooses one.
  bool is_loopback = true;         ///< No other machine can reach it.
};

/// Reads `127.0.0.1:5557`, `localhost:5557`, `[::1]:5557`, `*:5557` (all interfaces, IPv4) or the
/// address of an interface with a port. The port 0 lets the system choose.
/// @throws InvalidArgument reading `page = text (rule)`.
[[nodiscard]] PageAddress parse_page_address(std::string_view text);

/// `http://127.0.0.1:5557/`
[[nodiscard]] std::string url_of(const PageAddress& address);

}  // namespace proofmass::coordinator
