#include "tests/fuzz/seed_inputs.hpp"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/codec.hpp"
#include "tests/fuzz/fuzz_input.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/support/drawn_result.hpp"
#include "tests/support/messages.hpp"

namespace proofmass::test {
namespace {

template <typename Content>
std::string encoded(const Content& content, wire::SessionId session, wire::Epoch epoch,
                    std::uint64_t sequence) {
  proto::Envelope envelope = in_envelope(content);
  envelope.set_session(session.value);
  envelope.set_epoch(epoch.value);
  envelope.set_sequence(sequence);
  return wire::encode(std::move(envelope));
}

/// A worker process that says real things on one connection.
class Speaker {
 public:
  Speaker(std::vector<Step>& steps, std::uint8_t connection, std::uint64_t session)
      : steps_(steps), connection_(connection), session_{session} {}

  template <typename Content>
  void say(const Content& content, wire::Epoch epoch = fuzz_epoch) {
    steps_.push_back({.kind = StepKind::worker_message,
                      .number = connection_,
                      .value = 0,
                      .content = encoded(content, session_, epoch, ++sequence_)});
  }

  void say_hello(const std::string& host,
                 const std::optional<proto::FormerSession>& former = std::nullopt) {
    proto::Hello hello = make_hello("w", host, 4, model_version);
    hello.set_process_id(1000);
    hello.set_build("b");
    hello.set_reference_digest(fuzz_reference_digest);
    if (former) *hello.mutable_former() = *former;
    say(hello, wire::Epoch{});
  }

  /// Runs whose results were not taken before; besides some that it holds.
  void set_aside(wire::CampaignId campaign, RunRange runs, std::uint32_t attempt) {
    proto::Heartbeat heartbeat = make_heartbeat(8, {make_held(campaign, {1}, {{{0}, 2}})});
    *heartbeat.add_set_aside() = make_held(campaign, {attempt}, {runs});
    say(heartbeat);
  }

  /// Runs [first, first + count) are held; the first of them are being computed.
  void beat(wire::CampaignId campaign, std::uint64_t first, std::uint64_t count,
            std::uint32_t attempt = 1) {
    proto::Heartbeat heartbeat = make_heartbeat(8);
    heartbeat.set_num_steps_done(++num_steps_);
    if (count > 0) {
      *heartbeat.add_held() = make_held(campaign, {attempt}, {{{first}, count}});
      *heartbeat.add_computing() =
          make_computed_batch(campaign, {{{first}, std::min<std::uint64_t>(count, 4)}}, num_steps_);
    }
    say(heartbeat);
  }

  void deliver(wire::CampaignId campaign, std::uint64_t first, std::uint64_t count,
               std::uint32_t attempt = 1) {
    std::vector<wire::ComputedRun> results;
    for (std::uint64_t run = first; run < first + count; ++run) {
      wire::ComputedRun computed;
      computed.result = drawn_result({.run = {run}});
      computed.compute_s = 0.5;
      computed.elapsed_s = 8.0;
      results.push_back(computed);
    }
    say(make_result_batch(campaign, {attempt}, results));
  }

  void give_back(wire::CampaignId campaign, std::uint64_t first, std::uint64_t count) {
    say(make_give_back(wire::LossReason::drained, {make_held(campaign, {1}, {{{first}, count}})}));
  }

 private:
  std::vector<Step>& steps_;
  std::uint8_t connection_;
  wire::SessionId session_;
  std::uint64_t sequence_ = 0;
  std::uint32_t num_steps_ = 0;
};

Step happening(StepKind kind, std::uint8_t number = 0, std::uint16_t value = 0) {
  return {.kind = kind, .number = number, .value = value, .content = {}};
}

Step elapsed(std::uint16_t seconds) {
  constexpr std::uint16_t per_second = 100;
  return happening(StepKind::elapse, 0, static_cast<std::uint16_t>(seconds * per_second));
}

Step from_client(proto::RequestEnvelope request) {
  return {.kind = StepKind::client_request,
          .number = 0,
          .value = 0,
          .content = wire::encode(numbered(1, std::move(request)))};
}

Step to_client(proto::ReplyEnvelope reply) {
  return {.kind = StepKind::client_reply,
          .number = 0,
          .value = 0,
          .content = wire::encode(numbered(1, std::move(reply)))};
}

Step from_client(proto::ControlAction action, const std::string& campaign) {
  return from_client(control(action, campaign));
}

std::string worker_that_delivers() {
  std::vector<Step> steps;
  Speaker worker(steps, 0, 11);
  worker.say_hello("h");
  worker.beat(fuzz_campaign, 0, 0);
  worker.say(make_request(fuzz_campaign));
  worker.say(make_request(fuzz_campaign, 1000));
  worker.beat(fuzz_campaign, 0, 8);
  worker.deliver(fuzz_campaign, 0, 4);
  steps.push_back(happening(StepKind::commit, 3));
  worker.deliver(fuzz_campaign, 0, 4);  // Late, or repeated.
  steps.push_back(happening(StepKind::compare));
  steps.push_back(happening(StepKind::compare, 1));
  worker.give_back(fuzz_campaign, 4, 2);
  worker.say(make_bye(wire::LossReason::walltime));
  return to_bytes(steps);
}

std::string workers_that_are_lost() {
  std::vector<Step> steps;
  Speaker first(steps, 0, 11);
  Speaker second(steps, 1, 12);
  first.say_hello("h");
  second.say_hello("g");
  first.beat(fuzz_campaign, 0, 0);
  second.beat(fuzz_campaign, 0, 0);
  first.beat(fuzz_campaign, 0, 8);
  steps.push_back(happening(StepKind::gone, 0));
  steps.push_back(elapsed(20));
  second.beat(fuzz_campaign, 8, 8);
  first.deliver(fuzz_campaign, 0, 2);
  steps.push_back(elapsed(70));
  second.deliver(fuzz_campaign, 8, 8);
  second.beat(fuzz_campaign, 0, 2);
  steps.push_back(happening(StepKind::commit, 20));
  return to_bytes(steps);
}

/// The last run of a campaign crashes one worker after the other: three on one host, and one on
/// another.
std::string run_that_crashes_workers() {
  std::vector<Step> steps;
  steps.push_back(from_client(proto::CONTROL_ACTION_CANCEL, "table"));
  Speaker first(steps, 0, 11);
  first.say_hello("h");
  first.deliver(fuzz_campaign, 1, fuzz_num_runs - 1);
  steps.push_back(happening(StepKind::commit, fuzz_num_runs));
  first.say(make_bye(wire::LossReason::drained));
  for (std::uint8_t i = 1; i <= 4; ++i) {
    Speaker worker(steps, i, 11U + i);
    worker.say_hello(i < 4 ? "h" : "g");
    worker.beat(fuzz_campaign, 0, 0);
    steps.push_back(happening(StepKind::gone, i));
  }
  return to_bytes(steps);
}

/// All runs of the campaign with tables and audits, by two workers.
std::string campaign_that_is_audited() {
  std::vector<Step> steps;
  Speaker first(steps, 0, 11);
  Speaker second(steps, 1, 12);
  steps.push_back(from_client(proto::CONTROL_ACTION_CANCEL, "hardy2013"));
  first.say_hello("h");
  second.say_hello("g");
  for (std::uint64_t run = 0; run < fuzz_num_runs; run += 4) {
    first.beat(fuzz_table_campaign, 0, 0);
    first.deliver(fuzz_table_campaign, run, 4);
    steps.push_back(happening(StepKind::commit, 7));
    second.beat(fuzz_table_campaign, 0, 0);
    second.deliver(fuzz_table_campaign, run, 4, 2);
    steps.push_back(happening(StepKind::compare));
    steps.push_back(elapsed(1));
  }
  return to_bytes(steps);
}

std::string campaign_that_is_controlled() {
  std::vector<Step> steps;
  Speaker worker(steps, 0, 11);
  worker.say_hello("h");
  worker.beat(fuzz_campaign, 0, 0);
  steps.push_back(from_client(proto::CONTROL_ACTION_PAUSE, "hardy2013"));
  worker.beat(fuzz_campaign, 0, 8);
  steps.push_back(from_client(proto::CONTROL_ACTION_RESUME, "hardy2013"));
  steps.push_back(happening(StepKind::store_failure, 0));
  worker.deliver(fuzz_campaign, 0, 2);
  steps.push_back(happening(StepKind::store_failure, 1));
  steps.push_back(from_client(proto::CONTROL_ACTION_CANCEL, "table"));
  steps.push_back(from_client(proto::CONTROL_ACTION_RESUME, "table"));
  return to_bytes(steps);
}

std::string stranger() {
  std::vector<Step> steps;
  Speaker worker(steps, 0, 11);
  worker.beat(fuzz_campaign, 0, 8);  // Before Hello.
  worker.say(make_bye(), wire::Epoch{8});
  worker.say(proto::Stop());
  worker.say_hello("h");  // Is not listened to any more.
  Speaker other_model(steps, 1, 12);
  proto::Hello hello = make_hello("w", "h", 1, "other");
  hello.set_build("b");
  hello.set_reference_digest(1);
  *hello.mutable_former() = make_former({11});
  hello.mutable_former()->clear_signal();
  other_model.say(hello, wire::Epoch{});
  Speaker thief(steps, 2, 12);
  thief.say_hello("h");
  return to_bytes(steps);
}

/// Workers that are registered and say what cannot be: one lie each, at the very edge.
std::string liars() {
  constexpr std::uint64_t last = fuzz_num_runs - 1;
  constexpr std::uint32_t attempt_max = 0xffff'ffff;
  std::vector<Step> steps;
  std::uint8_t connection = 0;
  const auto lie = [&](const std::function<void(Speaker&)>& say) {
    Speaker worker(steps, connection, 11U + connection);
    worker.say_hello("h");
    worker.beat(fuzz_campaign, 0, 0);
    say(worker);
    ++connection;
  };
  lie([](Speaker& worker) { worker.deliver(fuzz_campaign, last, 2); });
  lie([](Speaker& worker) { worker.deliver({.value = 9}, 0, 1); });
  lie([](Speaker& worker) { worker.deliver(fuzz_campaign, 0, 1, attempt_max); });
  lie([](Speaker& worker) { worker.beat(fuzz_campaign, last, 2); });
  lie([](Speaker& worker) { worker.beat(fuzz_campaign, last, 1, attempt_max); });
  lie([](Speaker& worker) { worker.beat({.value = 9}, 0, 1); });
  lie([](Speaker& worker) { worker.set_aside(fuzz_campaign, {{1}, num_runs_max - 1}, 7); });
  lie([](Speaker& worker) { worker.give_back(fuzz_campaign, last, 2); });
  lie([](Speaker& worker) { worker.give_back(fuzz_table_campaign, 0, num_runs_max); });
  steps.push_back(elapsed(70));
  steps.push_back(elapsed(70));
  return to_bytes(steps);
}

/// Processes that hold runs and are said to have crashed, by the same host and by others.
std::string hosts_that_lie() {
  std::vector<Step> steps;
  for (std::uint8_t i = 0; i < 7; ++i) {
    Speaker worker(steps, i, 11U + i);
    const wire::SessionId former{10U + i};
    worker.say_hello(i < 4 ? "h" : "g", make_former(former));
    if (i != 2) worker.beat(fuzz_campaign, 0, 0);
  }
  steps.push_back(elapsed(16));  // Some make room for others.
  Speaker late(steps, 7, 30);
  late.say_hello("h");
  late.set_aside(fuzz_table_campaign, {{2}, 4}, 2);
  return to_bytes(steps);
}

MicroscopeCampaign campaign_with_table() {
  MicroscopeCampaign campaign;
  campaign.num_runs = 2;
  campaign.dispersions[3] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{1e-4, 2e-4}};
  return campaign;
}

std::string client_messages() {
  proto::CampaignStatus campaign = campaign_status("a", 0, 10);
  campaign.set_remaining_s(1.5);
  campaign.set_storage_failure("disk full");
  proto::FactoryStatus factory;
  proto::FactoryReport& report = *factory.mutable_report();
  report = factory_report("fleet", 30, proto::FACTORY_PHASE_WAITING);
  report.set_num_wanted(3);
  report.set_wait_s(60.0);
  report.set_reason("queue full");
  factory.set_owner("anna");
  proto::StatusReply status = status_with({campaign});
  status.set_version("0");
  status.set_num_slots(2);
  *status.add_factories() = factory;
  proto::RequestEnvelope status_request;
  status_request.mutable_status();
  proto::RequestEnvelope workers_request;
  workers_request.mutable_workers();
  return to_bytes({from_client(status_request), from_client(workers_request),
                   from_client(request_of(report)), to_client(reply_with(status)),
                   to_client(reply_with({worker_status(1, "w", "w")})),
                   to_client(wire::done_reply("done")), to_client(wire::error_reply("a = b (c)"))});
}

std::string submission() {
  const Definition definition = definition_of(campaign_with_table());
  return to_bytes(
      {from_client(test::submission(definition, {.priority = -5, .audit_fraction = 0.25}))});
}

std::string coordinator_messages() {
  std::vector<Step> steps;
  const auto add = [&](const auto& content) {
    steps.push_back({.kind = StepKind::coordinator_message,
                     .number = 0,
                     .value = 0,
                     .content = encoded(content, {11}, fuzz_epoch, steps.size() + 1)});
  };
  const RunRange runs{.first = {3}, .count = 2};
  add(make_welcome({1}, 5.0));
  add(make_reject(proto::REJECT_REASON_FULL, "full"));
  proto::RunLease lease = make_lease(fuzz_campaign, runs, {1}, {0.5, 0.25});
  lease.set_is_alone(true);
  lease.set_batch_runs_max(7);
  add(lease);
  add(make_retract(fuzz_campaign, {runs}));
  add(make_ack(fuzz_campaign, {{3}, {4}}));
  add(make_forget(fuzz_campaign, 20));
  add(make_not_served(fuzz_campaign));
  add(make_not_served(fuzz_campaign, {runs}));
  add(make_part(fuzz_campaign, 2, 5, 0xcbf29ce484222325U, "abc"));
  add(proto::HeartbeatAck());
  add(proto::Drain());
  add(proto::Stop());
  return to_bytes(steps);
}

}  // namespace

std::map<std::string, std::string> seed_inputs() {
  return {{"campaign_that_is_audited.bin", campaign_that_is_audited()},
          {"campaign_that_is_controlled.bin", campaign_that_is_controlled()},
          {"client_messages.bin", client_messages()},
          {"coordinator_messages.bin", coordinator_messages()},
          {"hosts_that_lie.bin", hosts_that_lie()},
          {"liars.bin", liars()},
          {"run_that_crashes_workers.bin", run_that_crashes_workers()},
          {"stranger.bin", stranger()},
          {"submission.bin", submission()},
          {"worker_that_delivers.bin", worker_that_delivers()},
          {"workers_that_are_lost.bin", workers_that_are_lost()}};
}

}  // namespace proofmass::test
