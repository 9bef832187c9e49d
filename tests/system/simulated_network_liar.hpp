#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "tests/system/simulated_network_execution.hpp"
#include "tests/system/simulated_network_time.hpp"

namespace proofmass::test {

/// Where all lies come from, with whatever key.
inline const std::string liar_address = "liar";

/// A worker, or several, with a valid key that says well-formed things which are not true: one kind
/// of lie for each message of a worker. It goes on for ever.
class Liar {
 public:
  using Send = std::function<void(wire::SessionId, wire::Message)>;

  /// @param draws, random  Outlive this object.
  Liar(const Draws& draws, const Poison& poison, Randomness& random, Send send);

  /// Says something, at random, of one of its sessions.
  void speak(const std::vector<wire::SessionId>& honest, const std::vector<std::string>& hosts);
  void hear(const wire::Packet& packet);
  [[nodiscard]] bool has(wire::SessionId session) const { return lent_.contains(session); }

 private:
  /// Where it does harm: what it makes of runs that it is lent, in most of its messages.
  enum class Habit : std::uint8_t { hoard, stall, give_back, crash, come_and_go, mixed };

  // One for each message of wire::WorkerMessage: another one without a lie does not compile.
  wire::Message lie(std::type_identity<wire::Hello>);
  wire::Message lie(std::type_identity<wire::Heartbeat>);
  wire::Message lie(std::type_identity<wire::ResultBatch>);
  wire::Message lie(std::type_identity<wire::GiveBack>);
  wire::Message lie(std::type_identity<wire::CampaignRequest>);
  wire::Message lie(std::type_identity<wire::Bye>);
  wire::Message lie(std::size_t kind);

  [[nodiscard]] std::size_t next_kind();
  void begin_again();
  wire::HeldRuns claim();
  std::vector<wire::HeldRuns> held();
  wire::ComputedRun made_up(const RunKey& key);
  RunKey any_run();

  const Draws& draws_;
  const Poison& poison_;
  Randomness& random_;
  Send send_;
  Habit habit_;
  bool is_single_minded_;  ///< Does nothing that its habit does not need.
  double truthfulness_;    ///< Probability that it delivers what it was lent, as it should.
  std::vector<wire::SessionId> sessions_;
  wire::SessionId session_;  ///< The one that speaks.
  wire::SessionId former_;   ///< Its own that "crashed".
  std::map<wire::SessionId, std::map<RunKey, wire::Attempt>> lent_;
  std::set<wire::SessionId> registered_;
  std::vector<wire::SessionId> honest_;
  std::vector<std::string> hosts_;
  std::uint32_t num_steps_done_ = 0;
};

}  // namespace proofmass::test
