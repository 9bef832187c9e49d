#include "proto/wire/codec.hpp"
#include "tests/system/simulated_network_coordinator.hpp"
#include "tests/test.hpp"

// What a coordinator may send, whatever has happened to it.

namespace proofmass::test {

using coordinator::Phase;

void PlayedCoordinator::check_sent(wire::WorkerId worker, const proto::Envelope& message) const {
  const auto peer = life_->peers.find(worker);
  ASSERT_TRUE(peer != life_->peers.end()) << "sent to a peer that has said nothing";
  proto::Envelope addressed = message;
  addressed.set_session(1);
  const auto decoded = wire::decode(wire::encode(addressed));
  EXPECT_TRUE(std::holds_alternative<proto::Envelope>(decoded)) << "the peer would refuse it";
  if (message.has_reject()) {
    check_reject(message.reject(), peer->second);
  } else {
    EXPECT_TRUE(peer->second.said_hello) << "sent to a peer that has not said Hello";
  }
  for (const std::uint64_t run : message.result_ack().runs()) {
    EXPECT_TRUE(files_.at({message.result_ack().campaign()}).num_commits.contains({run}))
        << "acknowledged before the commit";
  }
  if (message.has_run_lease()) check_lease(message.run_lease());
  if (message.has_forget()) check_forget(message.forget());
  if (message.has_not_served()) check_not_served(message.not_served());
}

/// A worker that does nothing wrong is never told that it must not come back, and nobody is kept
/// away for ever.
void PlayedCoordinator::check_reject(const proto::Reject& reject, const Peer& peer) const {
  const bool may_come_again = reject.reason() == proto::REJECT_REASON_NOT_REGISTERED ||
                              reject.reason() == proto::REJECT_REASON_FULL ||
                              reject.reason() == proto::REJECT_REASON_QUARANTINED;
  EXPECT_TRUE(may_come_again || !peer.is_honest) << reject.text();
  for (const auto& [host, until] : life_->state.quarantined) {
    EXPECT_GT(until, life_->state.ticked_at) << "a quarantine that does not end by itself";
  }
}

/// Nobody gets what it was not given, unless which runs that were is forgotten.
void PlayedCoordinator::check_adoptions(wire::WorkerId worker) const {
  const coordinator::State& state = life_->state;
  const auto found = state.workers.find(worker);
  if (found == state.workers.end() || state.attached.contains(found->second.session)) return;
  const auto lent = lent_.find(found->second.session);
  for (const coordinator::LeaseId id : found->second.leases) {
    const coordinator::Lease& lease = state.leases.at(id);
    if (!lease.is_adopted) continue;
    for (const RunRange& range : lease.remaining.ranges()) {
      for (RunIndex run = range.first; run.value < range.end(); ++run.value) {
        EXPECT_TRUE(lent != lent_.end() && lent->second.contains({lease.campaign, run}))
            << "claimed and never lent";
      }
    }
  }
}

void PlayedCoordinator::check_lease(const proto::RunLease& lease) const {
  const PlayedFile& file = files_.at({lease.campaign()});
  const RunRange runs = wire::runs_of(lease);
  EXPECT_GE(lease.attempt(), 1U);
  EXPECT_LE(runs.end(), file.num_runs());
  for (RunIndex run = runs.first; run.value < runs.end(); ++run.value) {
    EXPECT_TRUE(!file.num_commits.contains(run) ||
                coordinator::is_audited(file.stored.definition->seed, run,
                                        file.stored.control.audit_fraction))
        << "what was finished is computed again";
  }
}

/// Results are dropped only if nobody needs them.
void PlayedCoordinator::check_forget(const proto::Forget& forget) const {
  const PlayedFile& file = files_.at({forget.campaign()});
  EXPECT_LE(forget.num_runs(), file.num_runs()) << "forgets runs that the file does not know";
  const auto served = life_->state.campaigns.find({forget.campaign()});
  const Phase phase = served == life_->state.campaigns.end() ? file.phase : served->second.phase;
  EXPECT_TRUE(phase == Phase::finished || phase == Phase::cancelled)
      << "forgets a campaign that may be served later";
}

void PlayedCoordinator::check_not_served(const proto::NotServed& not_served) const {
  const wire::CampaignId campaign{not_served.campaign()};
  const auto served = life_->state.campaigns.find(campaign);
  if (not_served.ranges().empty()) {
    EXPECT_TRUE(served == life_->state.campaigns.end()) << "refuses what is served";
    return;
  }
  for (const proto::Range& range : not_served.ranges()) {
    EXPECT_GE(range.first(), files_.at(campaign).num_runs());
  }
}

}  // namespace proofmass::test
