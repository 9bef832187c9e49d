#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <variant>

#include "coordinator/dispatch/events.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/net/worker_gateway.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/codec.hpp"
#include "tests/coordinator/dispatch/invariants.hpp"
#include "tests/fuzz/fuzz_input.hpp"
#include "tests/proto/wire/requests.hpp"

namespace proofmass::test {
namespace {

using coordinator::TimePoint;
using wire::CampaignId;

constexpr std::size_t num_connections = 8;

std::shared_ptr<const Campaign> make_campaign(bool has_table) {
  MicroscopeCampaign campaign;
  campaign.num_runs = fuzz_num_runs;
  if (has_table) {
    campaign.name = "table";
    campaign.dispersions[3] = {.law = Law::table, .file = "f.csv", .column = "a"};
    campaign.table_columns = {std::vector<double>(fuzz_num_runs, 1e-4)};
  }
  campaign.validate();
  return std::make_shared<const MicroscopeCampaign>(std::move(campaign));
}

coordinator::StoredCampaign stored(bool has_table) {
  static const auto plain_definition = make_campaign(false);
  static const auto table_definition = make_campaign(true);
  coordinator::StoredCampaign campaign;
  campaign.definition = has_table ? table_definition : plain_definition;
  campaign.control.audit_fraction = has_table ? 0.5 : 0.0;
  if (has_table) campaign.finished = {{.first = {2}, .count = 3}};
  return campaign;
}

coordinator::DispatchConfig config() {
  coordinator::DispatchConfig config;
  config.reference_digest = fuzz_reference_digest;
  config.num_workers_max = 6;
  return config;
}

/// The coordinator without sockets and files, in a time of its own.
class World final : public coordinator::Outbox {
 public:
  World() : state_(initial_state(config(), {}, now_)), gateway_(state_, fuzz_epoch, callbacks()) {
    on_campaign(state_, fuzz_campaign, stored(false), now_, *this);
    on_campaign(state_, fuzz_table_campaign, stored(true), now_, *this);
    check_invariants(state_);
  }

  void play(const Step& step) {
    act(step);
    check_invariants(state_);
  }

  [[nodiscard]] const FuzzSummary& summary() const { return summary_; }

  // Outbox.
  void send(wire::WorkerId worker, proto::Envelope message) override {
    gateway_.send(worker, std::move(message));
  }
  void send_definition(wire::WorkerId worker, CampaignId campaign, std::uint64_t offset,
                       const std::shared_ptr<const Campaign>& definition) override {
    gateway_.send_definition(worker, campaign, offset, definition);
  }
  void write(CampaignId campaign, coordinator::Entry entry) override {
    using namespace coordinator;
    if (const auto* const delivery = std::get_if<Delivery>(&entry)) {
      const RunIndex run = delivery->result.run;
      PROOFMASS_EXPECT(run.value < fuzz_num_runs);
      PROOFMASS_EXPECT(handed_over_.emplace(campaign, run).second);
      to_commit_.emplace_back(campaign, run);
    } else if (const auto* const second = std::get_if<SecondDelivery>(&entry)) {
      to_compare_.emplace_back(campaign, second->delivery.result.run);
    } else if (const auto* const returned = std::get_if<ReturnedRuns>(&entry)) {
      PROOFMASS_EXPECT(returned->runs.count > 0 && returned->runs.end() <= fuzz_num_runs);
      summary_.num_lost += returned->runs.count;
    } else if (const auto* const given_up = std::get_if<GivenUpRun>(&entry)) {
      PROOFMASS_EXPECT(given_up->run.value < fuzz_num_runs);
      ++summary_.num_given_up;
    }
  }
  void log(coordinator::Event event, wire::CampaignId) override {
    // A line of the log is one line.
    PROOFMASS_EXPECT(to_text(event).find('\n') == std::string::npos);
  }

 private:
  coordinator::WorkerGateway::Callbacks callbacks() {
    return {.transmit =
                [this](const std::string&, const std::string& bytes) {
                  note_sent(bytes);
                  return true;
                },
            .is_allowed = [](const std::string&, TimePoint) { return true; }};
  }

  void note_sent(std::string_view bytes) {
    const auto decoded = wire::decode(bytes);
    const auto* const message = std::get_if<proto::Envelope>(&decoded);
    PROOFMASS_EXPECT(message != nullptr);
    summary_.num_leases += message->has_run_lease() ? 1U : 0U;
    summary_.num_rejections += message->has_reject() ? 1U : 0U;
  }

  static std::string routing_id(const Step& step) {
    return std::string(1, static_cast<char>('a' + step.number % num_connections));
  }

  /// Half of the connections come from each of two hosts.
  static std::string host(const Step& step) {
    return step.number % num_connections < num_connections / 2 ? "h" : "g";
  }

  void act(const Step& step) {
    switch (step.kind) {
      case StepKind::worker_message:
        return gateway_.receive(
            {.from = {.routing_id = routing_id(step), .key = "", .host = host(step)},
             .frames = {step.content}},
            now_, *this);
      case StepKind::client_request:
        return carry_out_request(step.content);
      case StepKind::client_reply:
        return check_reply(step.content);
      case StepKind::coordinator_message:
        return check_message(step.content);
      case StepKind::commit:
        return commit(std::size_t{step.number} + 1);
      case StepKind::compare:
        return compare_next(step.number % 2 == 0);
      case StepKind::elapse:
        return elapse(step.value * std::chrono::milliseconds(10));
      case StepKind::store_failure:
        return fail_or_recover(step.number % 2 == 0);
      case StepKind::gone:
        return end_process(step);
    }
  }

  /// What has been decoded is encoded and decoded again: to the same bytes.
  void check_message(std::string_view bytes) {
    const auto decoded = wire::decode(bytes);
    const auto* const message = std::get_if<proto::Envelope>(&decoded);
    if (message == nullptr) return;
    ++summary_.num_orders;
    const std::string once = wire::encode(*message);
    PROOFMASS_EXPECT(wire::encode(std::get<proto::Envelope>(wire::decode(once))) == once);
  }

  void check_reply(std::string_view bytes) {
    const auto decoded = wire::decode_reply(bytes);
    const auto* const reply = std::get_if<proto::ReplyEnvelope>(&decoded);
    if (reply == nullptr) return;
    ++summary_.num_replies;
    const std::string once = wire::encode(*reply);
    PROOFMASS_EXPECT(wire::encode(std::get<proto::ReplyEnvelope>(wire::decode_reply(once))) ==
                     once);
  }

  void carry_out_request(std::string_view bytes) {
    const auto decoded = wire::decode_request(bytes);
    const auto* const request = std::get_if<proto::RequestEnvelope>(&decoded);
    if (request == nullptr) return;
    ++summary_.num_requests;
    const std::string once = wire::encode(*request);
    auto again = std::get<proto::RequestEnvelope>(wire::decode_request(once));
    PROOFMASS_EXPECT(wire::encode(again) == once);
    if (request->has_submit()) {
      return read_definition(wire::take_definition(*again.mutable_submit()));
    }
    if (request->has_factory_report()) return take_report(request->factory_report());
    if (!request->has_control()) return;
    control_campaign(request->control().campaign() == "table" ? fuzz_table_campaign : fuzz_campaign,
                     request->control().action());
  }

  /// A definition is refused, or that of the campaign that is read from it.
  static void read_definition(const Definition& definition) {
    try {
      PROOFMASS_EXPECT(definition_of(campaign_of(definition)) == definition);
    } catch (const DefinitionError&) {
    }
  }

  void take_report(const proto::FactoryReport& report) {
    try {
      factories_.take(report, "anna", now_);
    } catch (const Error&) {
    }
    proto::StatusReply status = test::status_with({});
    for (const proto::FactoryStatus& factory : factories_.current(now_)) {
      *status.add_factories() = factory;
    }
    proto::ReplyEnvelope reply = test::reply_with(status);
    PROOFMASS_EXPECT(std::holds_alternative<proto::ReplyEnvelope>(
        wire::decode_reply(wire::encode(std::move(reply)))));
  }

  void control_campaign(CampaignId id, proto::ControlAction action) {
    const coordinator::Phase phase = state_.campaigns.at(id).phase;
    if (phase == coordinator::Phase::finished) return;
    if (action == proto::CONTROL_ACTION_PAUSE) return on_pause(state_, id, *this);
    if (action == proto::CONTROL_ACTION_CANCEL) return on_cancel(state_, id, *this);
    if (phase != coordinator::Phase::active) on_resume(state_, id, now_, *this);
  }

  void commit(std::size_t count_max) {
    std::map<CampaignId, std::vector<RunIndex>> committed;
    for (std::size_t i = 0; i < count_max && !to_commit_.empty(); ++i) {
      const auto [campaign, run] = to_commit_.front();
      committed[campaign].push_back(run);
      to_commit_.pop_front();
      ++summary_.num_committed;
    }
    for (const auto& [id, runs] : committed) on_committed(state_, id, runs, now_, *this);
  }

  void compare_next(bool is_equal) {
    if (to_compare_.empty()) return;
    const auto [campaign, run] = to_compare_.front();
    to_compare_.pop_front();
    ++summary_.num_compared;
    on_compared(state_, campaign, run, {}, is_equal, now_, *this);
  }

  void elapse(TimePoint::duration duration) {
    now_ += duration;
    on_tick(state_, now_, *this);
    gateway_.review(now_, *this);
  }

  void fail_or_recover(bool fails) {
    if (fails == is_failing_) return;
    is_failing_ = fails;
    if (fails) return on_store_failed(state_, fuzz_campaign, "disk full", *this);
    on_store_recovered(state_, fuzz_campaign, now_, *this);
  }

  void end_process(const Step& step) {
    const auto worker = gateway_.peers().worker_at(routing_id(step));
    if (!worker) return;
    const bool ran_out = step.number >= num_connections;
    on_gone(state_, *worker, ran_out ? wire::LossReason::out_of_memory : wire::LossReason::crashed,
            now_, *this);
  }

  TimePoint now_{};
  coordinator::State state_;
  coordinator::WorkerGateway gateway_;
  coordinator::FactoryReports factories_;
  std::set<std::pair<CampaignId, RunIndex>> handed_over_;
  std::deque<std::pair<CampaignId, RunIndex>> to_commit_;
  std::deque<std::pair<CampaignId, RunIndex>> to_compare_;
  bool is_failing_ = false;
  FuzzSummary summary_;
};

}  // namespace

FuzzSummary run_fuzz_input(std::string_view input) {
  World world;
  for (const Step& step : parse_steps(input)) world.play(step);
  return world.summary();
}

}  // namespace proofmass::test
