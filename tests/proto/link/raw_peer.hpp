#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

namespace proofmass::test {

/// A peer that speaks ZMTP 3.1 [ZeroMQ RFC 37] over a TCP socket of its own, without keys: it can
/// say what no library would.
class RawPeer {
 public:
  enum class Mechanism : std::uint8_t { null, curve };

  /// Connects; says nothing yet.
  /// @param endpoint  tcp://127.0.0.1:PORT.
  explicit RawPeer(const std::string& endpoint) : file_(socket(AF_INET, SOCK_STREAM, 0)) {
    // So that a test ends whatever the other end does.
    const timeval patience{.tv_sec = 5, .tv_usec = 0};
    setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(file_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    if (connect(file_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      close(file_);
      throw std::runtime_error("cannot connect to " + endpoint);
    }
  }
  ~RawPeer() { close(file_); }
  RawPeer(const RawPeer&) = delete;
  RawPeer& operator=(const RawPeer&) = delete;

  /// A greeting for that mechanism; nothing is read.
  void greet(Mechanism mechanism) {
    using namespace std::string_literals;
    std::string greeting = "\xff\0\0\0\0\0\0\0\0\x7f\x03\x01"s;
    greeting += mechanism == Mechanism::null ? "NULL" : "CURVE";
    greeting.resize(64);
    send(greeting);
  }

  /// The whole handshake of a DEALER without keys.
  void introduce() {
    greet(Mechanism::null);
    using namespace std::string_literals;
    send(frame(command,
               "\x05READY\x0bSocket-Type\0\0\0\x06"
               "DEALER"s));
    (void)read_exactly(64);
    (void)receive();
  }

  static constexpr char more = 1;
  static constexpr char command = 4;

  /// The bytes of a frame.
  [[nodiscard]] static std::string frame(char flags, std::string_view body) {
    std::string bytes = body.size() < 256 ? std::string{flags, static_cast<char>(body.size())}
                                          : head_of_large(flags, body.size());
    bytes += body;
    return bytes;
  }

  /// The bytes of the head of a frame with 256 bytes or more.
  [[nodiscard]] static std::string head_of_large(char flags, std::uint64_t size) {
    std::string head{static_cast<char>(flags | 2)};
    for (int shift = 56; shift >= 0; shift -= 8) head += static_cast<char>(size >> shift);
    return head;
  }

  [[nodiscard]] static std::string ping() {
    using namespace std::string_literals;
    return frame(command, "\4PING\0\0"s);
  }

  /// @throws std::runtime_error if the other end does not take them.
  void send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t count = ::send(file_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (count <= 0) throw std::runtime_error("the connection is closed");
      bytes.remove_prefix(static_cast<std::size_t>(count));
    }
  }

  /// The body of the next frame.
  [[nodiscard]] std::string receive() {
    const std::string head = read_exactly(2);
    constexpr int is_large = 2;
    if ((head[0] & is_large) == 0) return read_exactly(static_cast<std::uint8_t>(head[1]));
    std::uint64_t size = static_cast<std::uint8_t>(head[1]);
    for (const char byte : read_exactly(7)) size = size << 8 | static_cast<std::uint8_t>(byte);
    return read_exactly(size);
  }

  /// Hangs up so that the other end sees an error, whatever is still under way.
  void reset() {
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    setsockopt(file_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close(file_);
    file_ = -1;
  }

 private:
  std::string read_exactly(std::size_t size) {
    std::string bytes(size, '\0');
    std::size_t count = 0;
    while (count < size) {
      const ssize_t got = recv(file_, bytes.data() + count, size - count, 0);
      if (got <= 0) throw std::runtime_error("the connection is closed");
      count += static_cast<std::size_t>(got);
    }
    return bytes;
  }

  int file_;
};

}  // namespace proofmass::test
