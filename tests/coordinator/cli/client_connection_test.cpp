// A client against a coordinator that the test plays.

#include "coordinator/net/client_connection.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "coordinator/net/private_endpoint.hpp"
#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/coordinator/net/played_coordinator.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayedCoordinator;
using ::testing::StartsWith;

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
        return std::get<wire::DoneReply>(client.ask(wire::StatusRequest{})).text;
      } catch (const Error& error) {
        return std::string(error.what());
      }
    });
  }

  std::string failed(const std::string& reason) const {
    return "connect = " + endpoint_.address() + " (" + reason + ")";
  }

  PrivateEndpoint endpoint_;
};

TEST_F(ClientOfAPlayedCoordinator, GetsTheReplyToItsRequest) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  for (const std::string text : {"first", "second"}) {
    auto reply = ask(client);
    coordinator.answer(coordinator.receive().id, text);
    EXPECT_EQ(reply.get(), text);
  }
}

TEST_F(ClientOfAPlayedCoordinator, PassesOverTheReplyToAnEarlierRequest) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto first = ask(client);
  const std::uint64_t id = coordinator.receive().id;
  coordinator.answer(id, "first");
  EXPECT_EQ(first.get(), "first");
  auto second = ask(client);
  const std::uint64_t next_id = coordinator.receive().id;
  coordinator.answer(id, "first again");
  coordinator.answer(next_id, "second");
  EXPECT_EQ(second.get(), "second");
}

TEST_F(ClientOfAPlayedCoordinator, RefusesAReplyToNoRequestOfIts) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection client(config());
  auto reply = ask(client);
  coordinator.answer(coordinator.receive().id + 1, "x");
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
            failed("the coordinator is of another version: protocol_version = 99 (must be 7)"));
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
  const std::uint64_t id = coordinator->receive().id;
  coordinator.reset();
  coordinator = std::make_unique<PlayedCoordinator>(endpoint_.address());
  EXPECT_EQ(coordinator->receive().id, id);
  coordinator->answer(id, "after all");
  EXPECT_EQ(reply.get(), "after all");
}

TEST_F(ClientOfAPlayedCoordinator, GivesUpInTime) {
  ClientConnection client(config(0.02));
  EXPECT_EQ(ask(client).get(), failed("nobody there; waited 0.02 s"));
}

TEST_F(ClientOfAPlayedCoordinator, GivesUpOnACoordinatorThatIsSilent) {
  PlayedCoordinator coordinator(endpoint_.address());
  ClientConnection patient(config());
  auto reply = ask(patient);
  coordinator.answer(coordinator.receive().id, "x");
  EXPECT_EQ(reply.get(), "x");
  // Connecting takes less than this, so the silence is what ends it.
  ClientConnection client(config(0.5));
  EXPECT_EQ(ask(client).get(), failed("no answer within 0.5 s"));
}

TEST(ClientEndpoint, BeyondThisMachineNeedsKeys) {
  const auto refusal = [](const std::string& endpoint) -> std::string {
    try {
      const ClientConnection client({.endpoint = endpoint,
                                     .keys = {},
                                     .is_plain_waived = false,
                                     .reply_wait = std::chrono::seconds(1)});
    } catch (const InvalidArgument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal("tcp://10.0.0.1:5556"), StartsWith("connect = tcp://10.0.0.1:5556 ("));
  EXPECT_THAT(refusal("udp://x"), StartsWith("connect = udp://x ("));
  EXPECT_EQ(refusal("tcp://127.0.0.1:5556"), "accepted");
}

}  // namespace
}  // namespace proofmass::coordinator
