#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "tests/support/messages.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

/// An entry of a campaign's file.
template <typename Kind>
struct Recorded : Kind {
  wire::CampaignId campaign;
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
  void write(wire::CampaignId campaign, coordinator::Entry entry) override {
    using namespace coordinator;
    if (auto* const delivery = std::get_if<Delivery>(&entry)) {
      stored_.push_back({std::move(*delivery), campaign});
    } else if (auto* const second = std::get_if<SecondDelivery>(&entry)) {
      compared_.push_back({std::move(second->delivery), campaign});
    } else if (const auto* const returned = std::get_if<ReturnedRuns>(&entry)) {
      losses_.push_back({*returned, campaign});
    } else if (const auto* const given_up = std::get_if<GivenUpRun>(&entry)) {
      given_up_.push_back(given_up->run);
    } else if (const auto* const joined = std::get_if<WorkerJoined>(&entry)) {
      joined_.push_back({*joined, campaign});
    } else {
      ended_.push_back(std::get<WorkerEnded>(entry));
    }
  }
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
  std::vector<Recorded<coordinator::ReturnedRuns>> take_losses() {
    return std::exchange(losses_, {});
  }
  std::vector<RunIndex> take_given_up() { return std::exchange(given_up_, {}); }
  std::vector<std::string> take_events() { return std::exchange(events_, {}); }

  /// Workers of which files were told; not looked at by expect_nothing_more().
  std::vector<Recorded<coordinator::WorkerJoined>> take_joined() {
    return std::exchange(joined_, {});
  }
  std::vector<coordinator::WorkerEnded> take_ended() { return std::exchange(ended_, {}); }

  [[nodiscard]] const std::vector<Recorded<coordinator::Delivery>>& stored() const {
    return stored_;
  }
  [[nodiscard]] std::size_t num_sent() const { return sent_.size(); }

  /// Drops all that has been written down: what another test checks.
  void forget() {
    sent_.clear();
    definitions_.clear();
    stored_.clear();
    compared_.clear();
    losses_.clear();
    joined_.clear();
    ended_.clear();
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
  static std::vector<RunIndex> runs_of(const std::vector<Recorded<coordinator::Delivery>>& all) {
    std::vector<RunIndex> runs;
    for (const auto& delivery : all) runs.push_back(delivery.result.run);
    return runs;
  }

  std::vector<std::pair<wire::WorkerId, proto::Envelope>> sent_;
  std::vector<SentDefinition> definitions_;
  std::vector<Recorded<coordinator::Delivery>> stored_;
  std::vector<Recorded<coordinator::Delivery>> compared_;
  std::vector<Recorded<coordinator::ReturnedRuns>> losses_;
  std::vector<Recorded<coordinator::WorkerJoined>> joined_;
  std::vector<coordinator::WorkerEnded> ended_;
  std::vector<RunIndex> given_up_;
  std::vector<std::string> events_;
};

}  // namespace proofmass::test
