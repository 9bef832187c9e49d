#include "coordinator/net/client_gateway.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <new>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace proofmass::coordinator {
namespace {

/// A gateway whose requests are carried out when the test says so.
class ClientGatewayTest : public testing::Test {
 protected:
  void ask(const std::string& routing_id, std::uint64_t id) {
    const std::string bytes =
        wire::encode(wire::RequestPacket{.id = id, .request = wire::ReleaseHostRequest{"n7"}});
    campaign_service_.receive(
        {.from = {.routing_id = routing_id, .key = {}, .host = {}}, .frames = {bytes}});
  }

  /// The replies to a connection, in order: texts, and the numbers of their requests.
  [[nodiscard]] const std::vector<std::pair<std::uint64_t, std::string>>& replies_to(
      const std::string& routing_id) {
    return replies_[routing_id];
  }

  std::vector<Respond> carried_out;
  std::function<void()> before_asker = [] {};
  std::function<void()> before_carrying_out = [] {};

 private:
  ClientGateway::Surroundings surroundings() {
    return {.transmit = [this](const std::string& routing_id,
                               const std::string& bytes) { note(routing_id, bytes); },
            .asker_of =
                [this](const std::string&) {
                  before_asker();
                  return Asker{};
                },
            .carry_out =
                [this](const Request&, const Asker&, Respond respond) {
                  before_carrying_out();
                  carried_out.push_back(std::move(respond));
                },
            .now = [] { return TimePoint(); }};
  }

  void note(const std::string& routing_id, const std::string& bytes) {
    const auto packet = std::get<wire::ReplyPacket>(wire::decode_reply(bytes));
    const auto* const error = std::get_if<wire::ErrorReply>(&packet.reply);
    const auto* const done = std::get_if<wire::DoneReply>(&packet.reply);
    replies_[routing_id].emplace_back(packet.id, error != nullptr ? error->text : done->text);
  }

  std::map<std::string, std::vector<std::pair<std::uint64_t, std::string>>> replies_;
  Background background_{[] {}};
  ClientGateway campaign_service_{background_, surroundings()};
};

TEST_F(ClientGatewayTest, CarriesARepeatedRequestOutOnceAndTellsAllWhoWait) {
  ask("a", 5);
  ask("b", 5);
  ASSERT_EQ(carried_out.size(), 1U);
  carried_out[0](wire::DoneReply{"done"});
  for (const std::string client : {"a", "b"}) {
    ASSERT_EQ(replies_to(client).size(), 1U) << client;
    EXPECT_EQ(replies_to(client)[0].first, 5U);
    EXPECT_EQ(replies_to(client)[0].second, "done");
  }
  ask("a", 5);
  EXPECT_EQ(carried_out.size(), 2U);
}

TEST_F(ClientGatewayTest, LimitsHowManyWaitForTheSame) {
  for (std::size_t i = 0; i < ClientGateway::waiters_max; ++i) ask(std::to_string(i), 5);
  ask("late", 5);
  ASSERT_EQ(replies_to("late").size(), 1U);
  EXPECT_EQ(replies_to("late")[0].second,
            "request = the same 16 times (is being carried out; try again later)");
  ASSERT_EQ(carried_out.size(), 1U);
  carried_out[0](wire::DoneReply{"done"});
  EXPECT_EQ(replies_to("late").size(), 1U);
  EXPECT_EQ(replies_to("15").size(), 1U);
}

TEST_F(ClientGatewayTest, OutlivesWhateverIsThrown) {
  before_carrying_out = [] { throw std::bad_alloc(); };
  ask("a", 5);
  before_carrying_out = [] {};
  before_asker = [] { throw std::bad_alloc(); };
  ask("b", 5);
  before_asker = [] {};
  ask("c", 5);
  for (const std::string client : {"a", "b"}) {
    ASSERT_EQ(replies_to(client).size(), 1U) << client;
    EXPECT_EQ(replies_to(client)[0].second, "std::bad_alloc") << client;
  }
  EXPECT_EQ(carried_out.size(), 1U);
}

}  // namespace
}  // namespace proofmass::coordinator
