#include "tests/system/simulated_network_liar.hpp"

#include <array>
#include <iterator>
#include <utility>
#include <variant>

#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

constexpr std::size_t num_kinds = std::variant_size_v<wire::WorkerMessage>;

template <typename Kind, std::size_t i = 0>
consteval std::size_t kind_of() {
  if constexpr (std::is_same_v<Kind, std::variant_alternative_t<i, wire::WorkerMessage>>) {
    return i;
  } else {
    return kind_of<Kind, i + 1>();
  }
}

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

void Liar::hear(const wire::Packet& packet) {
  auto& lent = lent_.at(packet.header.session);
  if (std::holds_alternative<wire::Welcome>(packet.message)) {
    registered_.insert(packet.header.session);
  }
  if (std::holds_alternative<wire::Reject>(packet.message)) {
    registered_.erase(packet.header.session);
  }
  if (const auto* const lease = std::get_if<wire::RunLease>(&packet.message)) {
    for (RunIndex run = lease->runs.first; run.value < lease->runs.end(); ++run.value) {
      lent[{lease->campaign, run}] = lease->attempt;
    }
  }
  if (const auto* const ack = std::get_if<wire::ResultAck>(&packet.message)) {
    for (const RunIndex run : ack->runs) lent.erase({ack->campaign, run});
  }
}

void Liar::speak(const std::vector<wire::SessionId>& honest,
                 const std::vector<std::string>& hosts) {
  honest_ = honest;
  hosts_ = hosts;
  session_ = any_of(sessions_, random_);
  const std::size_t kind = next_kind();
  const bool crashes = kind == kind_of<wire::Hello>() && habit_ == Habit::crash;
  if (crashes || (kind == kind_of<wire::Hello>() && random_.happens(0.5))) begin_again();
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
std::size_t Liar::next_kind() {
  if (is_single_minded_) {
    if (!registered_.contains(session_)) return kind_of<wire::Hello>();
  } else if (random_.happens(0.15)) {
    return random_.below(num_kinds);
  } else if (random_.happens(0.2)) {
    return kind_of<wire::Hello>();
  }
  if (random_.happens(0.4)) return kind_of<wire::Heartbeat>();
  switch (habit_) {
    case Habit::hoard:
    case Habit::stall:
      return kind_of<wire::Heartbeat>();
    case Habit::give_back:
      return kind_of<wire::GiveBack>();
    case Habit::crash:
      return kind_of<wire::Hello>();
    case Habit::come_and_go:
      return kind_of<wire::Bye>();
    case Habit::mixed:
      break;
  }
  return random_.below(num_kinds);
}

wire::Message Liar::lie(std::size_t kind) {
  wire::Message message;
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    const auto say = [&]<typename Kind>(std::type_identity<Kind> type) { message = lie(type); };
    (void)((kind == i &&
            (say(std::type_identity<std::variant_alternative_t<i, wire::WorkerMessage>>{}),
             true)) ||
           ...);
  }
  (std::make_index_sequence<num_kinds>());
  return message;
}

RunKey Liar::any_run() { return any_of(draws_, random_).first; }

/// Runs of a whole campaign, or some of them.
wire::HeldRuns Liar::claim() {
  const auto [campaign, run] = any_run();
  const RunRange runs =
      random_.happens(0.5) ? RunRange{{0}, 2000} : RunRange{run, 1 + random_.below(4)};
  return {.campaign = campaign,
          .attempt = {static_cast<std::uint32_t>(1 + random_.below(9))},
          .ranges = {runs}};
}

std::vector<wire::HeldRuns> Liar::held() {
  std::vector<wire::HeldRuns> held;
  for (const auto& [key, attempt] : lent_.at(session_)) {
    held.push_back({.campaign = key.first, .attempt = attempt, .ranges = {{key.second, 1}}});
  }
  return held;
}

wire::Message Liar::lie(std::type_identity<wire::Hello>) {
  wire::Hello hello{.worker_name = "liar",
                    .host = hosts_.empty() ? "h" : any_of(hosts_, random_),
                    .process_id = 1,
                    .num_slots = static_cast<std::uint32_t>(1 + random_.below(8)),
                    .model_version = std::string(model_version),
                    .build = "test",
                    .former = {}};
  const wire::LossReason reason =
      random_.happens(0.5) ? wire::LossReason::crashed : wire::LossReason::out_of_memory;
  if (former_.value != 0) hello.former = wire::FormerSession{former_, reason, 11};
  if (!honest_.empty() && random_.happens(0.2)) {
    hello.former = wire::FormerSession{any_of(honest_, random_), reason, 11};
  }
  return hello;
}

wire::Message Liar::lie(std::type_identity<wire::Heartbeat>) {
  constexpr std::array<std::uint32_t, 3> credits{0, 8, 4096};
  wire::Heartbeat heartbeat{.num_runs_max = credits.at(random_.below(credits.size())),
                            .num_steps_done = ++num_steps_done_,
                            .held = held(),
                            .computing = {}};
  const bool seems_to_advance = habit_ != Habit::stall;
  for (const wire::HeldRuns& held : heartbeat.held) {
    heartbeat.computing.push_back({.campaign = held.campaign,
                                   .ranges = held.ranges,
                                   .num_steps_done = seems_to_advance ? num_steps_done_ : 1});
  }
  if (is_single_minded_) {
    heartbeat.num_runs_max = 4096;
    return heartbeat;
  }
  if (random_.happens(0.3)) heartbeat.computing.clear();
  if (random_.happens(0.2)) heartbeat.held.clear();
  if (random_.happens(0.3)) heartbeat.held.push_back(claim());
  if (random_.happens(0.2)) heartbeat.set_aside.push_back(claim());
  return heartbeat;
}

/// Of what was never lent to it, or was to another one of its sessions.
wire::ComputedRun Liar::made_up(const RunKey& key) {
  constexpr std::array times_s{0.0, 1.0, 1e9};
  RunResult result = zero_result({.run = key.second, .num_draws = 1});
  result.truth.front() = random_.uniform(1e-4);
  return {.result = std::move(result),
          .compute_s = times_s.at(random_.below(times_s.size())),
          .elapsed_s = times_s.at(random_.below(times_s.size()))};
}

wire::Message Liar::lie(std::type_identity<wire::ResultBatch>) {
  const auto& lent = lent_.at(session_);
  const bool tells_the_truth = !lent.empty() && random_.happens(truthfulness_);
  const RunKey key = tells_the_truth ? any_of(lent, random_).first : any_run();
  wire::ComputedRun computed = made_up(key);
  const bool is_harmful = poison_.crashing.contains(key) || poison_.hanging.contains(key);
  if (tells_the_truth && !is_harmful) {
    computed.result.num_draws = draws_.at(key).num_draws;
    computed.result.truth = draws_.at(key).truth;
  } else if (lent.contains(key)) {
    // What it is lent it may spoil, as a worker that computes wrongly. Here it does not.
    return lie(std::type_identity<wire::Heartbeat>{});
  }
  return wire::ResultBatch{.campaign = key.first,
                           .attempt = {static_cast<std::uint32_t>(1 + random_.below(9))},
                           .results = {std::move(computed)}};
}

wire::Message Liar::lie(std::type_identity<wire::GiveBack>) {
  constexpr std::array reasons{wire::LossReason::retracted, wire::LossReason::drained,
                               wire::LossReason::preempted, wire::LossReason::failed};
  std::vector<wire::HeldRuns> runs = held();
  if (runs.empty() || random_.happens(0.2)) runs.push_back(claim());
  return wire::GiveBack{.reason = reasons.at(random_.below(reasons.size())), .runs = runs};
}

wire::Message Liar::lie(std::type_identity<wire::CampaignRequest>) {
  return wire::CampaignRequest{.campaign = any_run().first, .offset = random_.below(1 << 20)};
}

wire::Message Liar::lie(std::type_identity<wire::Bye>) {
  return wire::Bye{random_.happens(0.5) ? wire::LossReason::failed : wire::LossReason::walltime};
}

}  // namespace proofmass::test
