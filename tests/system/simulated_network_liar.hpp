#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "proto/proofmass.pb.h"
#include "tests/system/simulated_network_execution.hpp"
#include "tests/system/simulated_network_time.hpp"

namespace proofmass::test {

/// Where all lies come from, with whatever key.
inline const std::string liar_address = "liar";

/// A worker, or several, with a valid key that says well-formed things which are not true: one kind
/// of lie for each message of a worker. It goes on for ever.
class Liar {
 public:
  using Send = std::function<void(wire::SessionId, proto::Envelope)>;

  /// @param draws, random  Outlive this object.
  Liar(const Draws& draws, const Poison& poison, Randomness& random, Send send);

  /// Says something, at random, of one of its sessions.
  void speak(const std::vector<wire::SessionId>& honest, const std::vector<std::string>& hosts);
  void hear(const proto::Envelope& message);
  [[nodiscard]] bool has(wire::SessionId session) const { return lent_.contains(session); }

 private:
  /// Where it does harm: what it makes of runs that it is lent, in most of its messages.
  enum class Habit : std::uint8_t { hoard, stall, give_back, crash, come_and_go, mixed };

  using Kind = proto::Envelope::FromWorkerCase;

  /// One for each message of a worker: another one without a lie does not compile.
  proto::Envelope lie(Kind kind);
  proto::Hello hello();
  proto::Heartbeat heartbeat();
  proto::Envelope results();
  proto::GiveBack give_back();

  [[nodiscard]] Kind next_kind();
  void begin_again();
  proto::HeldRuns claim();
  std::vector<proto::HeldRuns> held();
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
