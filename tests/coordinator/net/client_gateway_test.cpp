#include "coordinator/net/client_gateway.hpp"

#include <new>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// A gateway whose requests are carried out when the test says so.
class ClientGatewayTest : public testing::Test {
 protected:
  void ask(const std::string& routing_id, std::uint64_t id) {
    const std::string bytes = wire::encode(test::numbered(id, test::release("n7")));
    gateway_.receive(
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
  ClientGateway::Callbacks callbacks() {
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
            .now = [] { return TimePoint(); },
            .paths = ServerPaths("")};
  }

  void note(const std::string& routing_id, const std::string& bytes) {
    const auto reply = std::get<proto::ReplyEnvelope>(wire::decode_reply(bytes));
    replies_[routing_id].emplace_back(
        reply.request_id(), reply.has_error() ? reply.error().text() : reply.done().text());
  }

  std::map<std::string, std::vector<std::pair<std::uint64_t, std::string>>> replies_;
  Background background_{[] {}};
  ClientGateway gateway_{background_, callbacks()};
};

TEST_F(ClientGatewayTest, CarriesARepeatedRequestOutOnceAndTellsAllWhoWait) {
  ask("a", 5);
  ask("b", 5);
  ASSERT_EQ(carried_out.size(), 1U);
  carried_out[0](wire::done_reply("done"));
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
            "16 clients wait for the answer to this request already; try again later");
  ASSERT_EQ(carried_out.size(), 1U);
  carried_out[0](wire::done_reply("done"));
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

Definition some_definition() {
  MicroscopeCampaign campaign;
  campaign.name = "tables";
  campaign.num_runs = 2;
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{0.1, -2.0 / 3.0}};
  return definition_of(campaign);
}

TEST(RequestOf, HasTheCampaignThatTheDefinitionSays) {
  const Request request = request_of(test::submission(some_definition(), {.priority = -7}));
  EXPECT_EQ(request.campaign->definition(TableColumns::included), some_definition());
  EXPECT_EQ(request.campaign->table_columns[0][1], -2.0 / 3.0);
  EXPECT_EQ(request.message.submit().priority(), -7);
  EXPECT_FALSE(request.message.submit().has_definition());
}

TEST(RequestOf, RefusesADefinitionThatIsNone) {
  const auto refusal = [](const std::function<void(Definition&)>& change) {
    Definition definition = some_definition();
    change(definition);
    return test::message_of<DefinitionError>(
        [&] { (void)request_of(test::submission(definition)); });
  };
  EXPECT_EQ(refusal([](Definition& d) { d.text.insert(0, "x = 1\n"); }),
            "definition:1: x = 1 (unknown key)");
  EXPECT_EQ(refusal([](Definition& d) { d.text.replace(d.text.find("tables"), 6, "../a"); }),
            "definition:2: campaign.name = \"../a\" (must be 1 to 64 of [A-Za-z0-9._-], a letter "
            "or digit first)");
  EXPECT_NE(refusal([](Definition& d) { d.table_columns.clear(); }), "");
  EXPECT_NE(refusal([](Definition& d) { d.table_columns[0].pop_back(); }), "");
}

constexpr TimePoint start{};

std::uint64_t next_offset(const RequestParts::Outcome& outcome) {
  const auto& reply = std::get<proto::ReplyEnvelope>(outcome);
  EXPECT_TRUE(reply.has_part());
  return reply.part().next_offset();
}

bool is_refused(const RequestParts::Outcome& outcome) {
  const auto* const reply = std::get_if<proto::ReplyEnvelope>(&outcome);
  return reply != nullptr && reply->has_error();
}

TEST(RequestParts, MakeARequestWhole) {
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 0, "abc"), start)), 3U);
  EXPECT_EQ(parts.size_held(), 6U);
  const auto outcome = parts.take("a", 1, test::part(6, 3, "def"), start);
  EXPECT_EQ(std::get<std::string>(outcome), "abcdef");
  EXPECT_EQ(parts.size_held(), 6U);  // Until it has been read.
  parts.release(6);
  EXPECT_EQ(parts.size_held(), 0U);
}

TEST(RequestParts, OfSeveralConnectionsMayInterleave) {
  RequestParts parts;
  (void)parts.take("a", 1, test::part(4, 0, "ab"), start);
  (void)parts.take("b", 1, test::part(4, 0, "wx"), start);
  EXPECT_EQ(std::get<std::string>(parts.take("a", 1, test::part(4, 2, "cd"), start)), "abcd");
  EXPECT_EQ(std::get<std::string>(parts.take("b", 1, test::part(4, 2, "yz"), start)), "wxyz");
}

TEST(RequestParts, OutOfOrderAreAskedForAgain) {
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 3, "def"), start)), 0U);
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 0, "ab"), start)), 2U);
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 0, "ab"), start)), 2U);  // Repeated.
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 4, "ef"), start)), 2U);  // One is missing.
  const auto outcome = parts.take("a", 1, test::part(6, 2, "cdef"), start);
  EXPECT_EQ(std::get<std::string>(outcome), "abcdef");
}

TEST(RequestParts, OfAnotherRequestTakeThePlaceOfTheFirst) {
  RequestParts parts;
  (void)parts.take("a", 1, test::part(100, 0, "abc"), start);
  EXPECT_EQ(next_offset(parts.take("a", 2, test::part(10, 0, "xyz"), start)), 3U);
  EXPECT_EQ(parts.size_held(), 10U);
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(100, 3, "def"), start)), 0U);
  // The same number with another size is another request.
  EXPECT_EQ(next_offset(parts.take("a", 2, test::part(12, 0, "x"), start)), 1U);
  EXPECT_EQ(parts.size_held(), 12U);
}

TEST(RequestParts, TakeNoMoreMemoryThanTheyMay) {
  RequestParts parts(10);
  (void)parts.take("a", 1, test::part(6, 0, "a"), start);
  const auto refused = parts.take("b", 1, test::part(5, 0, "b"), start);
  EXPECT_EQ(std::get<proto::ReplyEnvelope>(refused).error().text(),
            "request size = 5 bytes (the coordinator is receiving 6 bytes of others, at most 10 "
            "together: try again later)");
  EXPECT_EQ(next_offset(parts.take("b", 1, test::part(4, 0, "b"), start)), 1U);
  // A whole one counts until it has been read.
  (void)parts.take("b", 1, test::part(4, 1, "bcd"), start);
  EXPECT_TRUE(is_refused(parts.take("c", 1, test::part(1, 0, "c"), start)));
  parts.release(4);
  EXPECT_TRUE(
      std::holds_alternative<std::string>(parts.take("c", 1, test::part(1, 0, "c"), start)));
}

// Room is counted with the first part of a request.
TEST(RequestParts, Take128MebibytesUnlessToldOtherwise) {
  constexpr std::uint64_t half = std::uint64_t{64} << 20;
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(half, 0, "a"), start)), 1U);
  EXPECT_EQ(next_offset(parts.take("b", 1, test::part(half, 0, "b"), start)), 1U);
  EXPECT_TRUE(is_refused(parts.take("c", 1, test::part(1, 0, "c"), start)));
}

TEST(RequestParts, ThatDoNotComeAreWaitedForHalfAMinute) {
  RequestParts parts;
  (void)parts.take("a", 1, test::part(6, 0, "abc"), start);
  (void)parts.take("b", 1, test::part(6, 0, "abc"), start + std::chrono::seconds(20));
  parts.drop_stale(start + std::chrono::seconds(31));
  EXPECT_EQ(parts.size_held(), 6U);
  EXPECT_EQ(next_offset(parts.take("a", 1, test::part(6, 3, "def"), start)), 0U);
}

}  // namespace
}  // namespace proofmass::coordinator
