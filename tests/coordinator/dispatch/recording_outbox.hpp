#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "tests/support/messages.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

/// A result that was handed over, and whose it is.
struct RecordedResult : wire::LeasedResult {
  wire::WorkerId worker;
};

/// Runs that came back without a result.
struct RecordedLoss : coordinator::ReturnedRuns {
  wire::CampaignId campaign;
  wire::WorkerId by;
};

/// Writes down what the dispatch does. Everything must be taken before the next event: what nobody
/// expected is found by expect_nothing_more().
class RecordingOutbox final : public coordinator::Outbox {
 public:
  void send(wire::WorkerId worker, proto::Envelope message) override {
    sent_.emplace_back(worker, std::move(message));
  }
  void send_definition(wire::WorkerId worker, wire::CampaignId campaign, std::uint64_t offset,
                       const std::shared_ptr<const Campaign>& definition) override {
    definitions_.push_back({worker, campaign, offset, definition});
  }
  void store(wire::WorkerId worker, wire::LeasedResult result) override {
    stored_.push_back({std::move(result), worker});
  }
  void compare(wire::WorkerId worker, wire::LeasedResult result) override {
    compared_.push_back({std::move(result), worker});
  }
  void record(wire::CampaignId campaign, wire::WorkerId worker,
              const coordinator::ReturnedRuns& returned) override {
    losses_.push_back({returned, campaign, worker});
  }
  void give_up(wire::CampaignId, RunIndex run) override { given_up_.push_back(run); }
  void log(coordinator::Event event, wire::CampaignId) override {
    events_.push_back(to_text(event));
  }

  /// The oldest message that has not been taken, which must be of this kind and for this worker.
  template <typename Content>
  Content take_sent(wire::WorkerId worker) {
    if (sent_.empty()) throw std::logic_error("nothing was sent");
    const auto [to, message] = sent_.front();
    sent_.erase(sent_.begin());
    EXPECT_EQ(to, worker);
    return content_of<Content>(message);
  }

  /// A part of a definition that was to be sent.
  struct SentDefinition {
    wire::WorkerId worker;
    wire::CampaignId campaign;
    std::uint64_t offset;
    std::shared_ptr<const Campaign> definition;
  };
  SentDefinition take_definition() {
    if (definitions_.empty()) throw std::logic_error("no definition was sent");
    SentDefinition definition = definitions_.front();
    definitions_.erase(definitions_.begin());
    return definition;
  }

  /// Drops a message of this kind to this worker, which there must be among others.
  template <typename Content>
  void drop_sent(wire::WorkerId worker) {
    const auto found = std::find_if(sent_.begin(), sent_.end(), [&](const auto& item) {
      return item.first == worker && holds<Content>(item.second);
    });
    if (found == sent_.end()) throw std::logic_error("no such message was sent");
    sent_.erase(found);
  }

  /// Runs handed to the store since the last call.
  std::vector<RunIndex> take_stored() { return runs_of(std::exchange(stored_, {})); }
  /// Runs handed over to be compared since the last call.
  std::vector<RunIndex> take_compared() { return runs_of(std::exchange(compared_, {})); }
  std::vector<RecordedLoss> take_losses() { return std::exchange(losses_, {}); }
  std::vector<RunIndex> take_given_up() { return std::exchange(given_up_, {}); }
  std::vector<std::string> take_events() { return std::exchange(events_, {}); }

  [[nodiscard]] const std::vector<RecordedResult>& stored() const { return stored_; }
  [[nodiscard]] std::size_t num_sent() const { return sent_.size(); }

  /// Drops all that has been written down: what another test checks.
  void forget() {
    sent_.clear();
    definitions_.clear();
    stored_.clear();
    compared_.clear();
    losses_.clear();
    given_up_.clear();
    events_.clear();
  }

  void expect_nothing_more() {
    for (const auto& [to, message] : sent_) {
      ADD_FAILURE() << message.ShortDebugString() << " to worker " << to.value;
    }
    EXPECT_EQ(definitions_.size(), 0U);
    EXPECT_EQ(take_stored().size(), 0U);
    EXPECT_EQ(take_compared().size(), 0U);
    EXPECT_EQ(take_losses().size(), 0U);
    EXPECT_EQ(take_given_up().size(), 0U);
    EXPECT_EQ(take_events(), std::vector<std::string>{});
    sent_.clear();
    definitions_.clear();
  }

 private:
  static std::vector<RunIndex> runs_of(const std::vector<RecordedResult>& results) {
    std::vector<RunIndex> runs;
    for (const auto& result : results) runs.push_back(result.computed.result.run);
    return runs;
  }

  std::vector<std::pair<wire::WorkerId, proto::Envelope>> sent_;
  std::vector<SentDefinition> definitions_;
  std::vector<RecordedResult> stored_;
  std::vector<RecordedResult> compared_;
  std::vector<RecordedLoss> losses_;
  std::vector<RunIndex> given_up_;
  std::vector<std::string> events_;
};

}  // namespace proofmass::test
