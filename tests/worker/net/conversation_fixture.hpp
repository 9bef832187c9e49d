#pragma once

#include <deque>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/runs.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass::worker {

/// Some runs of a lease.
struct WaitingRuns {
  wire::CampaignId campaign;
  RunRange runs;
  bool is_alone = false;
  std::uint32_t batch_runs_max = 0;
};

/// An execution that computes when the test says so.
class FakeExecution final : public Execution {
 public:
  bool is_defined(wire::CampaignId campaign) const override { return defined.contains(campaign); }
  void define(wire::CampaignId campaign, std::shared_ptr<const Campaign>) override {
    EXPECT_TRUE(defined.insert(campaign).second);
  }
  void submit(const proto::RunLease& lease, std::span<const RunRange> ranges) override {
    for (const RunRange& runs : ranges) {
      waiting.push_back({{lease.campaign()}, runs, lease.is_alone(), lease.batch_runs_max()});
    }
  }
  std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                     std::span<const RunRange> ranges) override {
    std::vector<RunIndex> dropped;
    for (const WaitingRuns& lease : std::exchange(waiting, {})) {
      for (const RunIndex run : indices_of(std::array{lease.runs})) {
        const auto has_run = [&](const RunRange& range) {
          return range.first <= run && run.value < range.end();
        };
        if (lease.campaign == campaign && std::ranges::any_of(ranges, has_run)) {
          dropped.push_back(run);
        } else {
          waiting.push_back({lease.campaign, {run, 1}, lease.is_alone, lease.batch_runs_max});
        }
      }
    }
    std::ranges::sort(dropped);
    return dropped;
  }
  bool drop_batch(std::uint64_t number) override {
    return std::erase_if(batches, [&](const auto& batch) { return batch.number == number; }) > 0;
  }
  void forget(wire::CampaignId campaign) override {
    defined.erase(campaign);
    forgotten.push_back(campaign);
  }
  void abandon() override { ++num_abandons; }
  std::vector<wire::LeasedResult> take_finished() override { return std::exchange(finished, {}); }
  std::vector<CrashedBatch> take_crashed() override { return {}; }
  std::vector<RunningBatch> computing() const override { return batches; }
  std::optional<Duration> usual_batch_time() const override { return batch_time; }
  std::uint64_t num_steps_done() const override { return 11; }
  std::optional<std::string> failure() const override { return failure_text; }

  /// The oldest lease becomes a batch.
  void begin_batch() {
    const WaitingRuns lease = take_oldest();
    batches.push_back({.number = batches.size() + 1,
                       .campaign = lease.campaign,
                       .ranges = {lease.runs},
                       .time_left = std::nullopt});
  }
  /// The oldest lease is computed.
  void finish_lease() {
    const WaitingRuns lease = take_oldest();
    finish(lease.campaign, {lease.runs});
  }
  /// The oldest batch is.
  void finish_batch() {
    const RunningBatch batch = batches.front();
    batches.erase(batches.begin());
    finish(batch.campaign, batch.ranges);
  }

  std::set<wire::CampaignId> defined;
  std::vector<wire::CampaignId> forgotten;
  std::deque<WaitingRuns> waiting;
  std::vector<RunningBatch> batches;
  std::vector<wire::LeasedResult> finished;
  std::optional<Duration> batch_time;
  std::optional<std::string> failure_text;
  int num_abandons = 0;

 private:
  WaitingRuns take_oldest() {
    const WaitingRuns lease = waiting.front();
    waiting.pop_front();
    return lease;
  }
  void finish(wire::CampaignId campaign, const std::vector<RunRange>& ranges) {
    for (const RunIndex run : indices_of(ranges)) {
      wire::LeasedResult done{.campaign = campaign, .attempt = {}, .computed = {}};
      done.computed.result = test::zero_result({.run = run});
      finished.push_back(done);
    }
  }
};

constexpr wire::SessionId own_session{77};
constexpr wire::Epoch first_epoch{5};
constexpr wire::CampaignId campaign_1{1};
constexpr wire::CampaignId campaign_2{2};

inline proto::RunLease lease(std::uint64_t first, std::uint64_t count, std::uint32_t attempt = 1,
                             wire::CampaignId campaign = campaign_1) {
  return test::make_lease(campaign, {{first}, count}, {attempt});
}

/// A definition of one part.
inline proto::DefinitionPart definition(wire::CampaignId campaign,
                                        const MicroscopeCampaign& content = {}) {
  return wire::EncodedDefinition(definition_of(content, TableColumns::left_out)).part(campaign, 0);
}

inline std::vector<proto::HeldRuns> held(std::uint64_t first, std::uint64_t count,
                                         std::uint32_t attempt = 1) {
  return {test::make_held(campaign_1, {attempt}, {{{first}, count}})};
}

/// A conversation; each test ends with a check that nothing was sent that it has not named.
class ConversationTest : public testing::Test {
 protected:
  proto::Envelope take_envelope() {
    if (sent.empty()) throw std::logic_error("nothing was sent");
    proto::Envelope envelope = sent.front();
    sent.pop_front();
    return envelope;
  }
  template <typename Content>
  Content take_sent() {
    return test::content_of<Content>(take_envelope());
  }

  template <typename Content>
  void receive(const Content& content, wire::Epoch epoch = first_epoch) {
    receive_in(session, content, epoch, ++num_received);
  }
  template <typename Content>
  void receive_in(wire::SessionId of, const Content& content, wire::Epoch epoch = first_epoch,
                  std::uint64_t number = 1) {
    proto::Envelope envelope = test::in_envelope(content);
    envelope.set_session(of.value);
    envelope.set_epoch(epoch.value);
    envelope.set_sequence(number);
    conversation->on_message(envelope, now);
  }
  void reject_unregistered(wire::Epoch epoch = first_epoch) {
    receive(test::make_reject(proto::REJECT_REASON_NOT_REGISTERED), epoch);
  }
  void tick_after(Duration time) { conversation->on_tick(now += time); }

  void start(const ConversationConfig& config = {}) {
    conversation.emplace(
        session, hello, execution,
        [this](proto::Envelope message) { sent.push_back(std::move(message)); }, now, config);
  }
  void register_here() {
    (void)take_sent<proto::Hello>();
    receive(welcome);
    (void)take_sent<proto::Heartbeat>();
  }
  /// Registered, and knows the first campaign.
  void register_with_campaign(const ConversationConfig& config = {}) {
    start(config);
    register_here();
    execution.defined.insert(campaign_1);
  }
  /// A lease of these runs arrives and is computed; its results have been sent.
  proto::ResultBatch compute(const proto::RunLease& lent) {
    receive(lent);
    execution.finish_lease();
    conversation->on_progress(now);
    return take_sent<proto::ResultBatch>();
  }
  void acknowledge(std::vector<RunIndex> runs) { receive(test::make_ack(campaign_1, runs)); }

  void expect_ending(Ending::Kind kind, const std::string& reason) {
    ASSERT_TRUE(conversation->ending().has_value());
    EXPECT_EQ(conversation->ending()->kind, kind);
    EXPECT_EQ(conversation->ending()->reason, reason);
  }
  /// It has said that it leaves, and its work is done.
  void expect_left(proto::LossReason reason, const std::string& ending) {
    EXPECT_EQ(take_sent<proto::Bye>().reason(), reason);
    expect_ending(Ending::Kind::done, ending);
  }

  void TearDown() override { EXPECT_TRUE(sent.empty()) << sent.front().ShortDebugString(); }

  const proto::Hello hello = test::make_hello("w", "h", 1, "m");
  const proto::Welcome welcome = test::make_welcome({1}, 2.0);
  wire::SessionId session = own_session;
  TimePoint now = TimePoint{} + std::chrono::hours(1);
  FakeExecution execution;
  std::deque<proto::Envelope> sent;
  std::uint64_t num_received = 0;
  std::optional<Conversation> conversation;
};

}  // namespace proofmass::worker
