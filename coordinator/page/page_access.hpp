#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/page/http_server.hpp"

namespace proofmass::coordinator {

/// Where a live page is served if no address is given.
inline constexpr std::string_view page_address_by_default = "127.0.0.1:5557";

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

class PageAccess {
 public:
  /// Without a token, the page is for this machine alone: the header Host must name loopback. Else
  /// a page of the internet could have its own name point to this machine and read along (DNS
  /// rebinding).
  PageAccess() = default;
  /// With a token the name does not matter, as the browser sends the cookie only to the name that
  /// set it. Only digests of the token are kept, so that it reaches no log.
  explicit PageAccess(std::string_view token);

  /// Reads a file that holds nothing but the token: 16 to 256 visible ASCII characters.
  /// @throws Error reading `page token file = PATH (rule)` if it cannot be read, is somebody
  ///         else's, can be read by others than its owner, or holds no such token. No message has
  ///         the token.
  [[nodiscard]] static PageAccess read(const std::filesystem::path& token_file);

  [[nodiscard]] bool has_token() const { return !cookie_.empty(); }

  /// Why a request is not answered; nothing if it is.
  [[nodiscard]] std::optional<HttpAnswer> refusal_of(const HttpRequest& request) const;

  /// The answer to a visit with the token in the address: sets the cookie and leads to the address
  /// without it. Nothing if the token is another one.
  [[nodiscard]] std::optional<HttpAnswer> welcome(std::string_view given_token) const;

 private:
  /// Takes the same time for each text of one length.
  [[nodiscard]] bool is_token(std::string_view text) const;
  [[nodiscard]] bool has_cookie(std::string_view header) const;

  std::array<unsigned char, 32> digest_{};
  std::string cookie_;  ///< NAME=VALUE that a browser keeps instead of the token, which it hides.
};

/// True if the header names this machine: `localhost`, an address 127.x.x.x or `[::1]`, with a port
/// or without.
[[nodiscard]] bool is_loopback_host(std::string_view host);

/// What the target of a request says, decoded: `/campaigns/a%20b?events=2` has the path
/// {campaigns, a b} and the parameter events.
struct PageRequest {
  /// None for `/`. No part is empty, `.` or `..`, or has a `/`.
  std::vector<std::string> path = {};
  std::map<std::string, std::string> parameters = {};

  [[nodiscard]] bool has(const std::string& parameter) const {
    return parameters.contains(parameter);
  }
  /// Empty if it is not there.
  [[nodiscard]] std::string text(const std::string& parameter) const;
  /// The value as a whole number; nothing if it is not there or no such number.
  [[nodiscard]] std::optional<std::uint64_t> number(const std::string& parameter) const;
};

/// Reads a target. Nothing if it is no path from `/` on, is badly encoded, has a part that is
/// empty, `.` or `..` or hides a `/` or a NUL, or has more than 16 parameters.
[[nodiscard]] std::optional<PageRequest> parse_target(std::string_view target);

/// Text as a part of a path or the value of a parameter: all but letters, digits and `-._~` is
/// written `%20`.
[[nodiscard]] std::string percent_encoded(std::string_view text);

}  // namespace proofmass::coordinator
