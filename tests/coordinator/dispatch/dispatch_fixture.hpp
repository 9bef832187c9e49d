#pragma once

#include "coordinator/dispatch/events.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/coordinator/dispatch/invariants.hpp"
#include "tests/coordinator/dispatch/recording_outbox.hpp"
#include "tests/support/drawn_result.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

using coordinator::CampaignState;
using coordinator::LeaseId;
using coordinator::StoredCampaign;
using coordinator::TimePoint;
using Strings = std::vector<std::string>;
using Runs = std::vector<RunIndex>;
using wire::Attempt;
using wire::CampaignId;
using wire::LossReason;
using wire::SessionId;
using wire::WorkerId;

/// A dispatch, two campaigns' names and some workers'. Each test ends with a check of the state and
/// that nothing was sent, stored or logged that the test has not named.
class DispatchFixture : public testing::Test {
 protected:
  static constexpr WorkerId first{1};
  static constexpr WorkerId second{2};
  static constexpr WorkerId third{3};
  static constexpr CampaignId one{101};
  static constexpr CampaignId two{102};

  /// The run times of computed() are believed.
  DispatchFixture() {
    config.lease_duration_max = std::chrono::hours(1);
    begin();
  }

  /// To be called again by a test that changes `config`. The coordinator before this one has lent
  /// runs to all workers.
  void begin(std::set<SessionId> awaited = {}) {
    state = coordinator::initial_state(config, std::move(awaited), now);
    state.attached = {session_of(first), session_of(second), session_of(third)};
  }

  static StoredCampaign stored_campaign(std::uint64_t num_runs) {
    MicroscopeCampaign campaign;
    campaign.num_runs = num_runs;
    return {.definition = std::make_shared<const MicroscopeCampaign>(campaign)};
  }

  /// A campaign of which nothing is known yet.
  void add_campaign(CampaignId id, std::uint64_t num_runs, int priority = 0,
                    double audit_fraction = 0.0) {
    StoredCampaign stored = stored_campaign(num_runs);
    stored.control.priority = priority;
    stored.control.audit_fraction = audit_fraction;
    on_campaign(state, id, stored, now, outbox);
  }

  static SessionId session_of(WorkerId id) { return {1000 + id.value}; }

  static proto::Hello hello(std::uint32_t num_slots = 1, const std::string& host = "host") {
    proto::Hello hello = make_hello("w", host, num_slots, model_version);
    hello.set_process_id(100);
    return hello;
  }

  /// Each host has an address of that name.
  void say_hello(WorkerId id, const proto::Hello& hello, const std::string& key = "") {
    on_hello(state, id, session_of(id), {.key = key, .address = hello.host()}, hello, now, outbox);
  }

  /// A worker that is registered and takes what it is lent.
  void add_worker(WorkerId id, std::uint32_t num_slots = 1, const std::string& host = "host") {
    add_worker(id, hello(num_slots, host));
  }
  void add_worker(WorkerId id, const proto::Hello& said) {
    say_hello(id, said);
    outbox.drop_sent<proto::Welcome>(id);
    (void)outbox.take_events();
    heartbeat(id);
  }

  /// A worker that is lent what there is; nobody looks.
  void add_busy_worker(WorkerId id, std::uint32_t num_slots = 1, const std::string& host = "host") {
    add_worker(id, num_slots, host);
    outbox.forget();
  }

  /// Its acknowledgement is taken; what else follows is not.
  void heartbeat(WorkerId id, const std::vector<proto::HeldRuns>& held = {},
                 const std::vector<proto::ComputedBatch>& computing = {},
                 std::uint32_t num_runs_max = 4096) {
    on_heartbeat(state, id, make_heartbeat(num_runs_max, held, computing), ++sequence, now, outbox);
    outbox.drop_sent<proto::HeartbeatAck>(id);
  }

  /// The runs of the oldest message to the worker, which must be a lease.
  RunRange taken_lease(WorkerId id) { return wire::runs_of(outbox.take_sent<proto::RunLease>(id)); }

  /// Likewise of one that takes runs back.
  std::vector<RunRange> taken_back(WorkerId id) {
    return wire::ranges_of(outbox.take_sent<proto::Retract>(id).ranges());
  }

  static proto::HeldRuns held(CampaignId id, RunRange runs, std::uint32_t attempt = 1) {
    return make_held(id, {attempt}, {runs});
  }

  /// So long that no more than two rounds are lent.
  static wire::ComputedRun computed(std::uint64_t run, RunStatus status = RunStatus::completed) {
    wire::ComputedRun result;
    result.result.run = {run};
    result.result.status = status;
    result.result = drawn_result(std::move(result.result));
    if (status == RunStatus::no_draw) result.result.num_draws = num_draws_max;
    if (status == RunStatus::not_converged) {
      result.result.num_rounds = static_cast<std::uint32_t>(EstimationConfig{}.num_rounds_max);
    }
    result.elapsed_s = 1000.0;
    return result;
  }

  void deliver(WorkerId id, CampaignId campaign, const std::vector<std::uint64_t>& runs,
               std::uint32_t attempt = 1) {
    std::vector<wire::ComputedRun> results;
    for (const std::uint64_t run : runs) results.push_back(computed(run));
    on_results(state, id, campaign, {attempt}, std::move(results), now, outbox);
  }

  void give_back(WorkerId id, const proto::HeldRuns& runs,
                 LossReason reason = LossReason::retracted) {
    on_give_back(state, id, make_give_back(reason, {runs}), now, outbox);
  }

  /// All runs that were handed to the store become durable.
  void commit(CampaignId id) { on_committed(state, id, outbox.take_stored(), now, outbox); }

  /// The runs are computed, stored and acknowledged; nobody looks.
  void complete(WorkerId id, CampaignId campaign, const std::vector<std::uint64_t>& runs) {
    deliver(id, campaign, runs);
    commit(campaign);
    outbox.forget();
  }

  /// The worker's process ends by a signal.
  void crash(WorkerId id) { on_gone(state, id, LossReason::crashed, now, outbox); }

  CampaignState& campaign(CampaignId id) { return state.campaigns.at(id); }

  void TearDown() override {
    outbox.expect_nothing_more();
    check_invariants(state);
  }

  coordinator::DispatchConfig config;
  coordinator::State state;
  RecordingOutbox outbox;
  TimePoint now{};
  std::uint64_t sequence = 0;
};

}  // namespace proofmass::test
