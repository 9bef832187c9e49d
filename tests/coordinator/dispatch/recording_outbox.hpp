#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/dispatch/dispatch.hpp"

namespace proofmass::test {

/// Writes down what the dispatch does. Everything must be taken before the next event: what nobody
/// expected is found by expect_nothing_more().
class RecordingOutbox final : public coordinator::Outbox {
 public:
  void send(wire::WorkerId worker, wire::Message message) override {
    sent_.emplace_back(worker, std::move(message));
  }
  void store(coordinator::Arrival arrival) override { stored_.push_back(std::move(arrival)); }
  void log(coordinator::Event event) override {
    events_.push_back(std::string(event.kind) + ' ' + event.text);
  }

  /// The oldest message that has not been taken, which must be of this kind and for this worker.
  template <typename Content>
  Content take_sent(wire::WorkerId worker) {
    if (sent_.empty()) throw std::logic_error("nothing was sent");
    const auto [to, message] = sent_.front();
    sent_.erase(sent_.begin());
    EXPECT_EQ(to, worker);
    return std::get<Content>(message);
  }

  /// Runs handed to the store since the last call.
  std::vector<RunIndex> take_stored() {
    std::vector<RunIndex> runs;
    for (const auto& arrival : std::exchange(stored_, {})) {
      runs.push_back(arrival.computed.result.run);
    }
    return runs;
  }

  [[nodiscard]] const std::vector<coordinator::Arrival>& stored() const { return stored_; }

  std::vector<std::string> take_events() { return std::exchange(events_, {}); }

  void expect_nothing_more() {
    EXPECT_EQ(sent_.size(), 0U);
    EXPECT_EQ(stored_.size(), 0U);
    EXPECT_EQ(take_events(), std::vector<std::string>{});
  }

 private:
  std::vector<std::pair<wire::WorkerId, wire::Message>> sent_;
  std::vector<coordinator::Arrival> stored_;
  std::vector<std::string> events_;
};

}  // namespace proofmass::test
