#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace proofmass::test {

/// A client that sends what it likes. A deadline of 20 s only keeps a failed test from hanging.
class RawClient {
 public:
  /// @param source  Address of this machine from which it comes.
  explicit RawClient(std::uint16_t port, const std::string& source = "127.0.0.1")
      : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    ::inet_pton(AF_INET, source.c_str(), &address.sin_addr);
    if (::bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot bind");
    }
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot connect");
    }
  }
  ~RawClient() { ::close(socket_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  void send(const std::string& bytes) const {
    (void)!::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  /// All until the server closes the connection.
  std::string rest() {
    std::string bytes;
    while (receive(bytes)) {
    }
    return bytes;
  }
  /// One answer with its content, on a connection that stays open.
  std::string answer() {
    std::string bytes;
    while (bytes.find("\r\n\r\n") == std::string::npos) {
      if (!receive(bytes)) return bytes;
    }
    const std::size_t content_at = bytes.find("\r\n\r\n") + 4;
    const std::size_t size_at = bytes.find("Content-Length: ");
    const std::size_t size = std::stoul(bytes.substr(size_at + 16));
    while (bytes.size() < content_at + size && receive(bytes)) {
    }
    return bytes;
  }
  std::string ask(const std::string& target) {
    send("GET " + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
    return answer();
  }

 private:
  bool receive(std::string& bytes) const {
    constexpr int patience_ms = 20'000;
    pollfd item{.fd = socket_, .events = POLLIN, .revents = 0};
    if (::poll(&item, 1, patience_ms) <= 0) throw std::runtime_error("no answer");
    std::array<char, 4096> part{};
    const ssize_t size = ::recv(socket_, part.data(), part.size(), 0);
    if (size > 0) bytes.append(part.data(), static_cast<std::size_t>(size));
    return size > 0;
  }

  int socket_;
};

}  // namespace proofmass::test
