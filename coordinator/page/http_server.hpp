#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace proofmass::coordinator {

/// What a client asks for: GET or HEAD, which are answered alike.
struct HttpRequest {
  std::string target = {};         ///< As it came: `/campaigns/a?events=2`.
  std::string host = {};           ///< The header Host; empty if there is none.
  std::string authorization = {};  ///< The header Authorization; empty if there is none.
  std::string cookie = {};         ///< The header Cookie; empty if there is none.
};

struct HttpAnswer {
  unsigned status = 200;
  std::string content_type = "text/html; charset=utf-8";
  std::string body = {};
  std::vector<std::pair<std::string, std::string>> headers = {};  ///< Beside those of HttpConfig.
  bool has_shown_token = false;  ///< The client has, and its connection is kept before others.
};

/// A line of plain text.
[[nodiscard]] HttpAnswer plain_answer(unsigned status, std::string_view text);

struct HttpConfig {
  std::string host = "127.0.0.1";  ///< Address of an interface, IPv4 or IPv6.
  std::uint16_t port = 0;          ///< 0: the system chooses one.
  std::size_t num_connections_max = 64;
  std::size_t header_size_max = 8192;                      ///< Bytes; more gets the status 431.
  std::chrono::milliseconds request_duration_max{10'000};  ///< From the first byte to the last.
  std::chrono::milliseconds answer_duration_max{30'000};   ///< Until the client has taken it.
  std::chrono::milliseconds idle_max{60'000};              ///< Of a connection that is kept.
  /// How long an answer that is not there yet is waited for; see HttpServer::Handler.
  std::chrono::milliseconds wait_max{1000};
  std::vector<std::pair<std::string, std::string>> headers = {};  ///< Of every answer.
};

struct HttpCounts {
  std::uint64_t num_connections = 0;  ///< Open now.
  std::uint64_t num_requests = 0;
  std::uint64_t num_refused = 0;  ///< Connections that were one too many: refused, or another one
                                  ///< was closed for them.
};

/// An HTTP/1.1 server for pages that people look at, in a thread of its own. One thread serves all
/// connections without ever waiting for one of them. Every step of a connection has a deadline for
/// the whole of it, so that a client that sends a byte a second gains nothing. A connection that is
/// one too many takes the place of one that asks nothing; see README.md.
///
/// It knows GET and HEAD; other methods get the status 405, and a request with content 413.
class HttpServer {
 public:
  /// Answers a request, in the server's thread. It returns nothing if what it needs is not there
  /// yet, and is then asked again every 20 ms; the last time with Patience::over, when it must
  /// answer. What it throws becomes the status 500.
  enum class Patience : std::uint8_t { left, over };
  using Handler = std::function<std::optional<HttpAnswer>(const HttpRequest&, Patience)>;

  /// Listens.
  /// @throws Error `page = HOST:PORT (reason)` if the address cannot be used.
  HttpServer(const HttpConfig& config, Handler handler);
  ~HttpServer();  ///< Closes all connections at once.
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] HttpCounts counts() const;  ///< From any thread.

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
