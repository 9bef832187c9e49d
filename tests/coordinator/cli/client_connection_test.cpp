// A client against a coordinator that the test plays.

#include "coordinator/net/client_connection.hpp"

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "coordinator/net/private_endpoint.hpp"
#include "core/error.hpp"
#include "tests/coordinator/net/played_coordinator.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayedCoordinator;

/// Takes connections to a socket file and breaks them off, as the near end of a tunnel does while
/// there is no coordinator at its far end.
class Tunnel {
 public:
  explicit Tunnel(const std::string& endpoint)
      : path_(endpoint.substr(std::string("ipc://").size())),
        listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    ::setsockopt(listener_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path - 1);
    ::unlink(path_.c_str());
    if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listener_, 8) != 0) {
      throw Error("cannot listen at " + endpoint);
    }
  }
  ~Tunnel() {
    ::close(listener_);
    ::unlink(path_.c_str());
  }
  Tunnel(const Tunnel&) = delete;
  Tunnel& operator=(const Tunnel&) = delete;

  void break_off(int num_connections) {
    for (int i = 0; i < num_connections; ++i) {
      const int connection = ::accept(listener_, nullptr, nullptr);
      if (connection < 0) throw Error("nobody connects");
      ::close(connection);
    }
  }

 private:
  std::string path_;
  int listener_;
};

class ClientOfAPlayedCoordinator : public testing::Test {
 protected:
  ClientConnectionConfig config(double reply_wait_s = 20.0) const {
    return {.endpoint = endpoint_.address(),
            .keys = {},
            .is_plain_waived = false,
            .reply_wait = std::chrono::duration<double>(reply_wait_s)};
  }

  /// Asks in a thread of its own: gives the text of the reply, or of what is thrown.
  std::future<std::string> ask(ClientConnection& client) {
    return std::async(std::launch::async, [&client] {
      try {
        proto::RequestEnvelope request;
        request.mutable_status();
        return client.ask(request).done().text();
      } catch (const Error& error) {
        return std::string(error.what());
      }
    });
  }

  /// What the client says of a peer that breaks off.
  std::string broken_off() const {
    return "coordinator = " + endpoint_.address() +
           " (breaks the connection off: it wants --keys, or is no coordinator)";
  }
  std::string failed(const std::string& reason) const {
    return "connect = " + endpoint_.address() + " (" + reason + ")";
  }

  PrivateEndpoint endpoint_;
};

TEST_F(ClientOfAPlayedCoordinator, PassesOverTheReplyToAnEarlierRequest) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto first = ask(client);
  const std::uint64_t id = coordinator.receive().request_id();
  coordinator.answer(id, "first");
  EXPECT_EQ(first.get(), "first");
  auto second = ask(client);
  const std::uint64_t next_id = coordinator.receive().request_id();
  coordinator.answer(id, "first again");
  coordinator.answer(next_id, "second");
  EXPECT_EQ(second.get(), "second");
}

TEST_F(ClientOfAPlayedCoordinator, RefusesAReplyToNoRequestOfIts) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  coordinator.answer(coordinator.receive().request_id() + 1, "x");
  EXPECT_EQ(reply.get(), failed("answers what was not asked"));
}

TEST_F(ClientOfAPlayedCoordinator, TakesAReplyWithoutANumberForItsOwn) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  (void)coordinator.receive();
  coordinator.answer(0, "request = 3 bytes (must be an envelope)");
  EXPECT_EQ(reply.get(), "request = 3 bytes (must be an envelope)");
}

TEST_F(ClientOfAPlayedCoordinator, SaysThatTheCoordinatorIsOfAnotherVersion) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  (void)coordinator.receive();
  coordinator.answer("\x08\x63");  // An envelope of version 99.
  EXPECT_EQ(reply.get(),
            failed("the coordinator is of another version: protocol_version = 99 (must be 8)"));
}

TEST_F(ClientOfAPlayedCoordinator, SaysThatSomethingElseAnswers) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  (void)coordinator.receive();
  coordinator.answer("HTTP/1.1 400");
  EXPECT_THAT(reply.get(), StartsWith("connect = " + endpoint_.address() +
                                      " (is it the coordinator's address for clients? reply = "));
}

TEST_F(ClientOfAPlayedCoordinator, AsksAgainWhenTheCoordinatorWasAway) {
  auto coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  const std::uint64_t id = coordinator->receive().request_id();
  coordinator.reset();
  coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  EXPECT_EQ(coordinator->receive().request_id(), id);
  coordinator->answer(id, "after all");
  EXPECT_EQ(reply.get(), "after all");
}

TEST_F(ClientOfAPlayedCoordinator, AsksAgainThroughATunnelWhenTheCoordinatorWasAway) {
  auto coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  const std::uint64_t id = coordinator->receive().request_id();
  coordinator.reset();
  Tunnel(endpoint_.address()).break_off(5);
  coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  EXPECT_EQ(coordinator->receive().request_id(), id);
  coordinator->answer(id, "after all");
  EXPECT_EQ(reply.get(), "after all");
}

// By the third connection the client's socket has seen two break, after which it is a refusal.
TEST_F(ClientOfAPlayedCoordinator, SaysWhatItMetWhenItsTimeRunsOut) {
  auto coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  ClientConnection client(config(0.5));
  auto reply = ask(client);
  coordinator->answer(coordinator->receive().request_id(), "x");
  EXPECT_EQ(reply.get(), "x");
  coordinator.reset();
  Tunnel(endpoint_.address()).break_off(3);
  EXPECT_EQ(ask(client).get(), broken_off());
}

TEST_F(ClientOfAPlayedCoordinator, DoesNotWaitForAPeerThatBreaksOffFromTheFirst) {
  Tunnel tunnel(endpoint_.address());
  ClientConnection client(config(3600.0));
  auto reply = ask(client);
  tunnel.break_off(2);
  EXPECT_EQ(reply.get(), broken_off());
}

}  // namespace
}  // namespace proofmass::coordinator
