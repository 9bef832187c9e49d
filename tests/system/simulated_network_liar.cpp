#include "tests/system/simulated_network_liar.hpp"

#include <array>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "core/microscope/simulation/run.hpp"
#include "core/runs.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

using Envelope = proto::Envelope;

constexpr std::array kinds{Envelope::kHello,       Envelope::kCampaignRequest, Envelope::kGiveBack,
                           Envelope::kResultBatch, Envelope::kHeartbeat,       Envelope::kBye};

template <typename Values>
auto any_of(const Values& values, Randomness& random) {
  auto one = values.begin();
  std::advance(one, static_cast<std::ptrdiff_t>(random.below(values.size())));
  return *one;
}

}  // namespace

Liar::Liar(const Draws& draws, const Poison& poison, Randomness& random, Send send)
    : draws_(draws),
      poison_(poison),
      random_(random),
      send_(std::move(send)),
      habit_(static_cast<Habit>(random.below(6))),
      is_single_minded_(random.happens(0.5)),
      truthfulness_(random.happens(0.5) ? 0.2 : 0.0) {
  const std::uint64_t num_sessions = 1 + random_.below(4);
  for (std::uint64_t i = 0; i < num_sessions; ++i) sessions_.push_back({random_.number()});
  for (const wire::SessionId session : sessions_) lent_[session];
}

void Liar::hear(const Envelope& message) {
  const wire::SessionId session{message.session()};
  auto& lent = lent_.at(session);
  if (message.has_welcome()) registered_.insert(session);
  if (message.has_reject()) registered_.erase(session);
  const proto::RunLease& lease = message.run_lease();
  for (const RunIndex run : indices_of(std::array{wire::runs_of(lease)})) {
    lent[{{lease.campaign()}, run}] = {lease.attempt()};
  }
  const proto::ResultAck& ack = message.result_ack();
  for (const std::uint64_t run : ack.runs()) lent.erase({{ack.campaign()}, {run}});
}

void Liar::speak(const std::vector<wire::SessionId>& honest,
                 const std::vector<std::string>& hosts) {
  honest_ = honest;
  hosts_ = hosts;
  session_ = any_of(sessions_, random_);
  const Kind kind = next_kind();
  const bool crashes = kind == Envelope::kHello && habit_ == Habit::crash;
  if (crashes || (kind == Envelope::kHello && random_.happens(0.5))) begin_again();
  send_(session_, lie(kind));
}

/// The process "ends", and another one takes its place.
void Liar::begin_again() {
  former_ = session_;
  std::erase(sessions_, session_);
  session_ = {random_.number()};
  sessions_.push_back(session_);
  lent_[session_];
}

/// Mostly it asks for runs and then does what is its habit.
Liar::Kind Liar::next_kind() {
  if (is_single_minded_) {
    if (!registered_.contains(session_)) return Envelope::kHello;
  } else if (random_.happens(0.15)) {
    return kinds.at(random_.below(kinds.size()));
  } else if (random_.happens(0.2)) {
    return Envelope::kHello;
  }
  if (random_.happens(0.4)) return Envelope::kHeartbeat;
  switch (habit_) {
    case Habit::hoard:
    case Habit::stall:
      return Envelope::kHeartbeat;
    case Habit::give_back:
      return Envelope::kGiveBack;
    case Habit::crash:
      return Envelope::kHello;
    case Habit::come_and_go:
      return Envelope::kBye;
    case Habit::mixed:
      break;
  }
  return kinds.at(random_.below(kinds.size()));
}

Envelope Liar::lie(Kind kind) {
  switch (kind) {
    case Envelope::kHello:
      return in_envelope(hello());
    case Envelope::kHeartbeat:
      return in_envelope(heartbeat());
    case Envelope::kResultBatch:
      return results();
    case Envelope::kGiveBack:
      return in_envelope(give_back());
    case Envelope::kCampaignRequest: {
      const wire::CampaignId campaign = any_run().first;
      return in_envelope(make_request(campaign, random_.below(1 << 20)));
    }
    case Envelope::kBye:
      return in_envelope(
          make_bye(random_.happens(0.5) ? wire::LossReason::failed : wire::LossReason::walltime));
    case Envelope::FROM_WORKER_NOT_SET:
      break;
  }
  throw std::logic_error("a worker does not say this");
}

RunKey Liar::any_run() { return any_of(draws_, random_).first; }

/// Runs of a whole campaign, or some of them.
proto::HeldRuns Liar::claim() {
  const auto [campaign, run] = any_run();
  const RunRange runs =
      random_.happens(0.5) ? RunRange{{0}, 2000} : RunRange{run, 1 + random_.below(4)};
  return make_held(campaign, {static_cast<std::uint32_t>(1 + random_.below(9))}, {runs});
}

std::vector<proto::HeldRuns> Liar::held() {
  std::vector<proto::HeldRuns> held;
  for (const auto& [key, attempt] : lent_.at(session_)) {
    held.push_back(make_held(key.first, attempt, {{key.second, 1}}));
  }
  return held;
}

proto::Hello Liar::hello() {
  const std::string host = hosts_.empty() ? "h" : any_of(hosts_, random_);
  proto::Hello hello =
      make_hello("liar", host, static_cast<std::uint32_t>(1 + random_.below(8)), model_version);
  if (random_.happens(0.2)) {
    hello.set_num_slots(hello.num_slots() + 60);
    hello.set_num_card_slots(60);
  }
  const wire::LossReason reason =
      random_.happens(0.5) ? wire::LossReason::crashed : wire::LossReason::out_of_memory;
  if (former_.value != 0) *hello.mutable_former() = make_former(former_, reason);
  if (!honest_.empty() && random_.happens(0.2)) {
    *hello.mutable_former() = make_former(any_of(honest_, random_), reason);
  }
  return hello;
}

proto::Heartbeat Liar::heartbeat() {
  constexpr std::array<std::uint32_t, 3> credits{0, 8, 4096};
  proto::Heartbeat heartbeat = make_heartbeat(credits.at(random_.below(credits.size())), held());
  heartbeat.set_num_steps_done(++num_steps_done_);
  const bool seems_to_advance = habit_ != Habit::stall;
  for (const proto::HeldRuns& held : heartbeat.held()) {
    *heartbeat.add_computing() = make_computed_batch(
        {held.campaign()}, wire::ranges_of(held.ranges()), seems_to_advance ? num_steps_done_ : 1);
  }
  if (is_single_minded_) {
    heartbeat.set_num_runs_max(4096);
    return heartbeat;
  }
  if (random_.happens(0.3)) heartbeat.clear_computing();
  if (random_.happens(0.2)) heartbeat.clear_held();
  if (random_.happens(0.3)) *heartbeat.add_held() = claim();
  if (random_.happens(0.2)) *heartbeat.add_set_aside() = claim();
  return heartbeat;
}

/// Of what was never lent to it, or was to another one of its sessions.
wire::ComputedRun Liar::made_up(const RunKey& key) {
  constexpr std::array times_s{0.0, 1.0, 1e9};
  RunResult result = zero_result({.run = key.second, .num_draws = 1});
  result.truth.front() = random_.uniform(1e-4);
  return {.result = std::move(result),
          .compute_s = times_s.at(random_.below(times_s.size())),
          .elapsed_s = times_s.at(random_.below(times_s.size())),
          .is_by_card = random_.happens(0.5)};
}

Envelope Liar::results() {
  const auto& lent = lent_.at(session_);
  const bool tells_the_truth = !lent.empty() && random_.happens(truthfulness_);
  const RunKey key = tells_the_truth ? any_of(lent, random_).first : any_run();
  wire::ComputedRun computed = made_up(key);
  if (tells_the_truth && !poison_.has(key)) {
    computed.result.num_draws = draws_.at(key).num_draws;
    computed.result.truth = draws_.at(key).truth;
  } else if (lent.contains(key)) {
    // What it is lent it may spoil, as a worker that computes wrongly. Here it does not.
    return in_envelope(heartbeat());
  }
  const wire::Attempt attempt{static_cast<std::uint32_t>(1 + random_.below(9))};
  return in_envelope(make_result_batch(key.first, attempt, {computed}));
}

proto::GiveBack Liar::give_back() {
  constexpr std::array reasons{wire::LossReason::retracted, wire::LossReason::drained,
                               wire::LossReason::preempted, wire::LossReason::failed,
                               wire::LossReason::crashed};
  std::vector<proto::HeldRuns> runs = held();
  if (runs.empty() || random_.happens(0.2)) runs.push_back(claim());
  return make_give_back(reasons.at(random_.below(reasons.size())), runs);
}

}  // namespace proofmass::test
