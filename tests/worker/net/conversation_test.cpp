#include "worker/net/conversation.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <stdexcept>
#include <utility>

namespace proofmass::worker {
namespace {

using namespace std::chrono_literals;

/// An execution that finishes what the test says.
class FakeExecution final : public Execution {
 public:
  void start(std::shared_ptr<const Campaign>) override { ++num_starts; }
  void submit(wire::RunLease lease) override { leases.push_back(std::move(lease)); }
  void abandon() override {
    ++num_abandons;
    leases.clear();
  }
  std::vector<FinishedRun> take_finished() override { return std::exchange(finished, {}); }
  std::vector<wire::LeaseId> open_leases() const override {
    std::vector<wire::LeaseId> open;
    for (const auto& lease : leases) open.push_back(lease.lease);
    return open;
  }
  std::uint64_t num_orbits_done() const override { return 11; }
  std::optional<std::string> failure() const override { return failure_; }

  /// The oldest lease is computed.
  void finish_lease() {
    const wire::RunLease lease = leases.front();
    leases.pop_front();
    for (std::uint64_t run = lease.runs.first.value; run < lease.runs.end(); ++run) {
      FinishedRun done{.lease = lease.lease, .attempt = lease.attempt, .computed = {}};
      done.computed.result.run = {run};
      finished.push_back(done);
    }
  }

  std::deque<wire::RunLease> leases;
  std::vector<FinishedRun> finished;
  std::optional<std::string> failure_;
  int num_starts = 0;
  int num_abandons = 0;
};

wire::RunLease lease(std::uint64_t id, std::uint64_t first, std::uint64_t count) {
  return {.lease = {id}, .runs = {{first}, count}, .attempt = {1}, .table_values = {}};
}

/// A conversation; each test ends with a check that nothing was sent that it has not named.
class ConversationTest : public testing::Test {
 protected:
  template <typename Content>
  Content take_sent() {
    if (sent.empty()) throw std::logic_error("nothing was sent");
    const wire::Message message = sent.front();
    sent.pop_front();
    return std::get<Content>(message);
  }

  void register_here() {
    (void)take_sent<wire::Hello>();
    conversation.on_message(welcome, now);
    (void)take_sent<wire::Heartbeat>();
    (void)take_sent<wire::Credit>();
  }

  /// A lease of these runs arrives and is computed; its results have been sent.
  wire::ResultBatch compute(const wire::RunLease& lent) {
    conversation.on_message(lent, now);
    execution.finish_lease();
    conversation.on_progress(now);
    return take_sent<wire::ResultBatch>();
  }

  void expect_ending(Ending::Kind kind, const std::string& reason) {
    ASSERT_TRUE(conversation.ending().has_value());
    EXPECT_EQ(conversation.ending()->kind, kind);
    EXPECT_EQ(conversation.ending()->reason, reason);
  }

  void TearDown() override { EXPECT_EQ(sent.size(), 0U); }

  const wire::Hello hello{
      .worker_name = "w", .host = "h", .process_id = 1, .num_slots = 1, .model_version = "m"};
  wire::Welcome welcome{
      .worker = {1}, .heartbeat_interval_s = 2.0, .campaign = std::make_shared<const Campaign>()};
  TimePoint now{};
  FakeExecution execution;
  std::deque<wire::Message> sent;
  Conversation conversation{hello, execution,
                            [this](const wire::Message& message) { sent.push_back(message); }, now};
};

TEST_F(ConversationTest, SaysHelloUntilItIsWelcome) {
  EXPECT_EQ(take_sent<wire::Hello>().worker_name, "w");
  conversation.on_tick(now += 900ms);
  EXPECT_TRUE(sent.empty());
  conversation.on_tick(now += 100ms);
  (void)take_sent<wire::Hello>();
  conversation.on_message(welcome, now);
  (void)take_sent<wire::Heartbeat>();
  EXPECT_EQ(take_sent<wire::Credit>().num_runs_max, wire::runs_per_lease_max);
  EXPECT_EQ(execution.num_starts, 1);
  conversation.on_message(welcome, now);  // The answer to the other Hello changes nothing.
  EXPECT_EQ(execution.num_starts, 1);
}

// The first Hello is lost if the connection was not there yet.
TEST_F(ConversationTest, SaysHelloAgainOnceItIsConnected) {
  (void)take_sent<wire::Hello>();
  conversation.on_connected(now += 10ms);
  (void)take_sent<wire::Hello>();
  conversation.on_tick(now += 990ms);
  EXPECT_TRUE(sent.empty());
  conversation.on_message(welcome, now);
  (void)take_sent<wire::Heartbeat>();
  (void)take_sent<wire::Credit>();
  conversation.on_connected(now);
  EXPECT_TRUE(sent.empty()) << "it is registered";
}

TEST_F(ConversationTest, HandsALeaseToTheExecutionOnce) {
  register_here();
  conversation.on_message(lease(4, 10, 2), now);
  conversation.on_message(lease(4, 10, 2), now);
  ASSERT_EQ(execution.leases.size(), 1U);
  EXPECT_EQ(execution.leases[0].runs, (RunRange{{10}, 2}));
}

TEST_F(ConversationTest, SendsResultsOfALeaseTogether) {
  register_here();
  const wire::ResultBatch batch = compute(lease(4, 10, 2));
  EXPECT_EQ(batch.lease, wire::LeaseId{4});
  ASSERT_EQ(batch.results.size(), 2U);
  EXPECT_EQ(batch.results[1].result.run, RunIndex{11});
}

TEST_F(ConversationTest, RepeatsResultsUntilTheyAreAcknowledged) {
  register_here();
  (void)compute(lease(4, 10, 2));
  conversation.on_message(wire::ResultAck{.runs = {{10}}}, now);
  EXPECT_EQ(conversation.num_unacknowledged(), 1U);

  conversation.on_tick(now += 5s);
  const auto again = take_sent<wire::ResultBatch>();
  ASSERT_EQ(again.results.size(), 1U);
  EXPECT_EQ(again.results[0].result.run, RunIndex{11});
  EXPECT_EQ(take_sent<wire::Heartbeat>().leases, std::vector<wire::LeaseId>{{4}});
  (void)take_sent<wire::Credit>();

  conversation.on_message(wire::ResultAck{.runs = {{11}}}, now);
  conversation.on_tick(now += 5s);
  EXPECT_TRUE(take_sent<wire::Heartbeat>().leases.empty());
  (void)take_sent<wire::Credit>();
}

TEST_F(ConversationTest, CountsUnacknowledgedResultsAgainstItsCredit) {
  register_here();
  (void)compute(lease(4, 0, 96));
  conversation.on_tick(now += 2s);
  (void)take_sent<wire::Heartbeat>();
  EXPECT_EQ(take_sent<wire::Credit>().num_runs_max, 4000U);
}

TEST_F(ConversationTest, ShowsThatItLives) {
  register_here();
  conversation.on_tick(now += 1900ms);
  EXPECT_TRUE(sent.empty());
  conversation.on_tick(now += 100ms);
  EXPECT_EQ(take_sent<wire::Heartbeat>().num_orbits_done, 11U);
  (void)take_sent<wire::Credit>();
}

TEST_F(ConversationTest, RegistersAgainAndKeepsItsResults) {
  register_here();
  (void)compute(lease(4, 10, 1));
  conversation.on_message(lease(5, 11, 1), now);
  conversation.on_message(wire::Reject{.reason = wire::RejectReason::not_registered, .text = ""},
                          now);
  (void)take_sent<wire::Hello>();
  EXPECT_EQ(execution.num_abandons, 1);
  conversation.on_message(lease(6, 12, 1), now);  // Of the registration that is over.
  EXPECT_TRUE(execution.leases.empty());

  conversation.on_message(welcome, now);
  EXPECT_EQ(take_sent<wire::ResultBatch>().results[0].result.run, RunIndex{10});
  (void)take_sent<wire::Heartbeat>();
  (void)take_sent<wire::Credit>();
  EXPECT_EQ(execution.num_starts, 1) << "the campaign is the same";
}

TEST_F(ConversationTest, SaysHelloOnceIfItIsRejectedTwice) {
  register_here();
  const wire::Reject reject{.reason = wire::RejectReason::not_registered, .text = ""};
  conversation.on_message(reject, now);
  conversation.on_message(reject, now);
  (void)take_sent<wire::Hello>();
}

TEST_F(ConversationTest, EndsIfTheCoordinatorServesAnotherCampaign) {
  register_here();
  conversation.on_message(wire::Reject{.reason = wire::RejectReason::not_registered, .text = ""},
                          now);
  (void)take_sent<wire::Hello>();
  Campaign other;
  other.seed = 2;
  welcome.campaign = std::make_shared<const Campaign>(other);
  conversation.on_message(welcome, now);
  expect_ending(Ending::Kind::failed, "the coordinator serves another campaign now");
}

TEST_F(ConversationTest, EndsIfItIsRefused) {
  (void)take_sent<wire::Hello>();
  conversation.on_message(
      wire::Reject{.reason = wire::RejectReason::incompatible, .text = "other model"}, now);
  expect_ending(Ending::Kind::failed, "refused by the coordinator: other model");
}

TEST_F(ConversationTest, EndsIfTheCoordinatorIsSilentForAMinute) {
  (void)take_sent<wire::Hello>();
  conversation.on_message(welcome, now += 10s);
  sent.clear();
  conversation.on_tick(now += 59s);
  EXPECT_FALSE(conversation.ending().has_value());
  sent.clear();
  conversation.on_tick(now += 1s);
  expect_ending(Ending::Kind::failed, "coordinator = silent for 60 s (is it running?)");
}

TEST_F(ConversationTest, EndsIfALeaseLacksTableValues) {
  Campaign campaign;
  campaign.dispersions[0] = {.law = Law::table, .file = "f", .column = "c"};
  welcome.campaign = std::make_shared<const Campaign>(campaign);
  register_here();
  conversation.on_message(lease(1, 0, 2), now);
  expect_ending(Ending::Kind::failed, "table_values = 0 entries (must be 1 for each run)");
}

TEST_F(ConversationTest, EndsIfNothingCanBeComputed) {
  register_here();
  execution.failure_ = "out of memory";
  conversation.on_progress(now);
  (void)take_sent<wire::Bye>();
  expect_ending(Ending::Kind::failed, "out of memory");
}

TEST_F(ConversationTest, DropsEverythingWhenToldToStop) {
  register_here();
  conversation.on_message(lease(1, 0, 2), now);
  conversation.on_message(wire::Stop{}, now);
  EXPECT_TRUE(execution.leases.empty());
  expect_ending(Ending::Kind::done, "told to stop");
}

TEST_F(ConversationTest, GivesEverythingBackWhenAskedToStop) {
  register_here();
  conversation.on_message(lease(1, 0, 2), now);
  conversation.on_stop_request();
  (void)take_sent<wire::Bye>();
  EXPECT_TRUE(execution.leases.empty());
  expect_ending(Ending::Kind::done, "asked to stop");
}

TEST_F(ConversationTest, DeliversWhatItHoldsWhenDrained) {
  register_here();
  conversation.on_message(lease(1, 0, 1), now);
  conversation.on_message(wire::Drain{}, now);
  EXPECT_EQ(take_sent<wire::Credit>().num_runs_max, 0U);
  conversation.on_message(lease(2, 1, 1), now);  // Crossed the Drain: not taken.
  EXPECT_EQ(execution.leases.size(), 1U);
  execution.finish_lease();
  conversation.on_progress(now);
  (void)take_sent<wire::ResultBatch>();
  EXPECT_FALSE(conversation.ending().has_value());
  conversation.on_message(wire::ResultAck{.runs = {{0}}}, now);
  (void)take_sent<wire::Bye>();
  expect_ending(Ending::Kind::done, "drained");
}

}  // namespace
}  // namespace proofmass::worker
