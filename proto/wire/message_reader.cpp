#include "proto/wire/message_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::wire::detail {
namespace {

constexpr std::size_t reject_text_size_max = 4096;
constexpr double heartbeat_interval_s_max = 3600.0;
constexpr std::uint64_t signal_max = 64;
/// Some 30 years: the times of any number of runs can be added up.
constexpr double time_s_max = 1e9;

CampaignId checked_campaign(std::uint64_t id) { return {checked_id(id, "campaign")}; }

Attempt checked_attempt(std::uint32_t attempt) {
  return {static_cast<std::uint32_t>(checked_id(attempt, "attempt"))};
}

RunIndex checked_run(std::uint64_t run) {
  require_in(run, 0, num_runs_max - 1, "run");
  return {run};
}

template <typename Ranges>
std::vector<RunRange> read_ranges(const Ranges& messages) {
  require_count(messages.size(), 1, ranges_per_message_max, "ranges");
  std::vector<RunRange> ranges;
  for (const auto& message : messages) {
    require_in(message.count(), 1, num_runs_max, "range count");
    require_in(message.first(), 0, num_runs_max - message.count(), "range first");
    ranges.push_back({.first = {message.first()}, .count = message.count()});
  }
  return ranges;
}

/// @param num_ranges  Of the message so far; grows.
HeldRuns read_held(const proto::HeldRuns& message, std::size_t& num_ranges) {
  HeldRuns held{.campaign = checked_campaign(message.campaign()),
                .attempt = checked_attempt(message.attempt()),
                .ranges = read_ranges(message.ranges())};
  num_ranges += held.ranges.size();
  require_in(num_ranges, 0, ranges_per_message_max, "number of ranges");
  return held;
}

LossReason checked_reason(proto::LossReason value, std::initializer_list<LossReason> allowed) {
  const auto reason = static_cast<LossReason>(value);
  require(std::find(allowed.begin(), allowed.end(), reason) != allowed.end(), "reason",
          fmt::format("{}", static_cast<int>(value)), "must be one that this message may give");
  return reason;
}

Message read(const proto::Hello& message) {
  require_in(message.num_slots(), 1, slots_max, "num_slots");
  Hello hello{.worker_name = checked_name(message.worker_name(), "worker_name"),
              .host = checked_name(message.host(), "host"),
              .process_id = message.process_id(),
              .num_slots = message.num_slots(),
              .model_version = checked_name(message.model_version(), "model_version"),
              .build = checked_name(message.build(), "build"),
              .reference_digest = message.reference_digest(),
              .former = {}};
  if (!message.has_former()) return hello;
  const proto::FormerSession& former = message.former();
  require_in(former.signal(), 0, signal_max, "former signal");
  hello.former = FormerSession{
      .session = {checked_id(former.session(), "former session")},
      .reason = checked_reason(former.reason(), {LossReason::crashed, LossReason::out_of_memory}),
      .signal = former.signal()};
  return hello;
}

Message read(const proto::Welcome& message) {
  const double interval_s = message.heartbeat_interval_s();
  require(interval_s > 0.0 && interval_s <= heartbeat_interval_s_max, "heartbeat_interval_s",
          fmt::format("{}", interval_s),
          fmt::format("must be in (0, {}]", heartbeat_interval_s_max));
  return Welcome{.worker = {checked_id(message.worker_id(), "worker_id")},
                 .heartbeat_interval_s = interval_s};
}

Message read(const proto::Reject& message) {
  const int reason = static_cast<int>(message.reason());
  require(reason >= 1 && reason <= 6, "reason", fmt::format("{}", reason), "must be in [1, 6]");
  require(message.text().size() <= reject_text_size_max, "text",
          fmt::format("{} bytes", message.text().size()),
          fmt::format("must be at most {}", reject_text_size_max));
  return Reject{.reason = static_cast<RejectReason>(reason), .text = printable(message.text())};
}

Message read(const proto::CampaignRequest& message) {
  require_in(message.offset(), 0, definition_size_max - 1, "offset");
  return CampaignRequest{.campaign = checked_campaign(message.campaign()),
                         .offset = message.offset()};
}

Message read(const proto::DefinitionPart& message) {
  require_in(message.total_size(), 1, definition_size_max, "total_size");
  require_in(message.content().size(), 1,
             std::min<std::uint64_t>(definition_part_size_max, message.total_size()),
             "content size");
  require_in(message.offset(), 0, message.total_size() - message.content().size(), "offset");
  return DefinitionPart{.campaign = checked_campaign(message.campaign()),
                        .offset = message.offset(),
                        .total_size = message.total_size(),
                        .checksum = message.checksum(),
                        .content = message.content()};
}

Message read(const proto::Forget& message) {
  require_in(message.num_runs(), 1, num_runs_max, "num_runs");
  return Forget{.campaign = checked_campaign(message.campaign()), .num_runs = message.num_runs()};
}

Message read(const proto::NotServed& message) {
  NotServed not_served{.campaign = checked_campaign(message.campaign()), .ranges = {}};
  if (message.ranges_size() > 0) not_served.ranges = read_ranges(message.ranges());
  return not_served;
}

Message read(const proto::RunLease& message) {
  require_in(message.num_runs(), 1, runs_per_lease_max, "num_runs");
  require_in(message.first_run(), 0, num_runs_max - message.num_runs(), "first_run");
  const auto& values = message.table_values();
  const auto num_runs = static_cast<int>(message.num_runs());
  const std::size_t num_drawn = model().drawn().size();
  require(values.size() % num_runs == 0 &&
              static_cast<std::size_t>(values.size() / num_runs) <= num_drawn,
          "table_values", fmt::format("{} entries", values.size()),
          fmt::format("must be the same number for each run, at most {}", num_drawn));
  const bool all_finite =
      std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  require(all_finite, "table_values", "not finite", "must be finite");
  return RunLease{.campaign = checked_campaign(message.campaign()),
                  .runs = {.first = {message.first_run()}, .count = message.num_runs()},
                  .attempt = checked_attempt(message.attempt()),
                  .is_alone = message.is_alone(),
                  .batch_runs_max = message.batch_runs_max(),
                  .table_values = {values.begin(), values.end()}};
}

Message read(const proto::Retract& message) {
  return Retract{.campaign = checked_campaign(message.campaign()),
                 .ranges = read_ranges(message.ranges())};
}

Message read(const proto::GiveBack& message) {
  require_count(message.runs_size(), 1, ranges_per_message_max, "runs");
  GiveBack give_back{
      .reason = checked_reason(message.reason(),
                               {LossReason::retracted, LossReason::drained, LossReason::walltime,
                                LossReason::preempted, LossReason::failed}),
      .runs = {}};
  std::size_t num_ranges = 0;
  for (const auto& held : message.runs()) give_back.runs.push_back(read_held(held, num_ranges));
  return give_back;
}

void require_size(int size, std::size_t must, std::string_view field) {
  if (static_cast<std::size_t>(size) == must) return;
  throw ConfigError(field, fmt::format("{} entries", size),
                    fmt::format("must be {} with this status", must));
}

/// Values in range, one for each of `count`.
template <typename Values>
std::vector<double> read_values(const Values& values, std::size_t count, std::string_view field) {
  require_size(values.size(), count, field);
  for (const double value : values) {
    if (!is_in_range(value)) {
      throw ConfigError(field, fmt::format("{}", value),
                        fmt::format("must be in [{}, {}]", -magnitude_max, magnitude_max));
    }
  }
  return {values.begin(), values.end()};
}

double checked_time(double time_s, std::string_view field) {
  if (checked_magnitude(time_s, field) <= time_s_max) return time_s;
  throw ConfigError(field, fmt::format("{}", time_s), fmt::format("must be <= {}", time_s_max));
}

std::vector<double> read_health(const proto::ComputedRun& message, bool has_health,
                                const std::vector<HealthQuantity>& quantities) {
  require_size(message.health_size(), has_health ? quantities.size() : 0, "health");
  std::vector<double> health(message.health().begin(), message.health().end());
  for (std::size_t i = 0; i < health.size(); ++i) {
    if (health[i] >= 0.0 && health[i] <= magnitude_max) continue;
    throw ConfigError(fmt::format("health.{}", quantities[i].column()),
                      fmt::format("{}", health[i]),
                      fmt::format("must be in [0, {}]", magnitude_max));
  }
  return health;
}

Loss read_loss(const proto::ComputedRun& message, bool is_lost, const ResultSchema& schema) {
  require_in(message.loss_cause(), is_lost ? 1 : 0, is_lost ? schema.loss_causes.size() : 0,
             "loss_cause");
  require_in(message.loss_session(), is_lost ? 1 : 0, is_lost ? schema.loss_sessions.size() : 0,
             "loss_session");
  return {.cause = message.loss_cause(), .session = message.loss_session()};
}

/// Every list is as long as the model's results say; its numbers are in range.
void read_values(const proto::ComputedRun& message, RunResult& result) {
  const ResultSchema& schema = model().results();
  const std::size_t num_quantities = schema.quantities.size();
  const auto num_errors = static_cast<std::size_t>(
      std::ranges::count_if(schema.quantities, &Quantity::has_standard_error));
  const bool has_errors = result.has_estimate() && message.standard_error_size() > 0;
  result.truth = read_values(message.truth(), result.has_truth() ? num_quantities : 0, "truth");
  result.estimate =
      read_values(message.estimate(), result.has_estimate() ? num_quantities : 0, "estimate");
  result.standard_error =
      read_values(message.standard_error(), has_errors ? num_errors : 0, "standard_error");
  result.health = read_health(message, result.has_truth(), schema.health);
  result.loss = read_loss(message, result.status == RunStatus::lost, schema);
}

ComputedRun read_run(const proto::ComputedRun& message) {
  const int status = static_cast<int>(message.status());
  require_in(static_cast<std::uint64_t>(status), 1, 5, "status");
  RunResult result;
  result.run = checked_run(message.run());
  result.status = static_cast<RunStatus>(status);
  result.num_draws = message.num_draws();
  result.num_rounds = message.num_rounds();
  read_values(message, result);
  return {.result = std::move(result),
          .compute_s = checked_time(message.compute_s(), "compute_s"),
          .elapsed_s = checked_time(message.elapsed_s(), "elapsed_s")};
}

Message read(const proto::ResultBatch& message) {
  require_count(message.results_size(), 1, runs_per_lease_max, "results");
  ResultBatch batch{.campaign = checked_campaign(message.campaign()),
                    .attempt = checked_attempt(message.attempt()),
                    .results = {}};
  batch.results.reserve(static_cast<std::size_t>(message.results_size()));
  for (const auto& run : message.results()) batch.results.push_back(read_run(run));
  return batch;
}

Message read(const proto::ResultAck& message) {
  require_count(message.runs_size(), 1, runs_per_lease_max, "runs");
  ResultAck ack{.campaign = checked_campaign(message.campaign()), .runs = {}};
  for (const std::uint64_t run : message.runs()) ack.runs.push_back(checked_run(run));
  return ack;
}

Message read(const proto::Heartbeat& message) {
  require_in(message.num_runs_max(), 0, runs_per_lease_max, "num_runs_max");
  require_count(message.held_size(), 0, ranges_per_message_max, "held");
  require_count(message.set_aside_size(), 0, ranges_per_message_max, "set_aside");
  require_count(message.computing_size(), 0, slots_max, "computing");
  Heartbeat heartbeat{.num_runs_max = message.num_runs_max(),
                      .num_steps_done = message.num_steps_done(),
                      .held = {},
                      .computing = {}};
  std::size_t num_held = 0;
  for (const auto& held : message.held()) heartbeat.held.push_back(read_held(held, num_held));
  for (const auto& held : message.set_aside()) {
    heartbeat.set_aside.push_back(read_held(held, num_held));
  }
  std::size_t num_computing = 0;
  for (const auto& batch : message.computing()) {
    heartbeat.computing.push_back({.campaign = checked_campaign(batch.campaign()),
                                   .ranges = read_ranges(batch.ranges()),
                                   .num_steps_done = batch.num_steps_done()});
    num_computing += heartbeat.computing.back().ranges.size();
    require_in(num_computing, 0, ranges_per_message_max, "number of ranges");
  }
  return heartbeat;
}

Message read(const proto::Bye& message) {
  return Bye{.reason =
                 checked_reason(message.reason(), {LossReason::drained, LossReason::walltime,
                                                   LossReason::preempted, LossReason::failed})};
}

Message read(const proto::HeartbeatAck&) { return HeartbeatAck{}; }
Message read(const proto::Drain&) { return Drain{}; }
Message read(const proto::Stop&) { return Stop{}; }

}  // namespace

Message read_message(const proto::Envelope& envelope) {
  switch (envelope.message_case()) {
    case proto::Envelope::kHello:
      return read(envelope.hello());
    case proto::Envelope::kWelcome:
      return read(envelope.welcome());
    case proto::Envelope::kReject:
      return read(envelope.reject());
    case proto::Envelope::kCampaignRequest:
      return read(envelope.campaign_request());
    case proto::Envelope::kDefinitionPart:
      return read(envelope.definition_part());
    case proto::Envelope::kForget:
      return read(envelope.forget());
    case proto::Envelope::kNotServed:
      return read(envelope.not_served());
    case proto::Envelope::kRunLease:
      return read(envelope.run_lease());
    case proto::Envelope::kRetract:
      return read(envelope.retract());
    case proto::Envelope::kGiveBack:
      return read(envelope.give_back());
    case proto::Envelope::kResultBatch:
      return read(envelope.result_batch());
    case proto::Envelope::kResultAck:
      return read(envelope.result_ack());
    case proto::Envelope::kHeartbeat:
      return read(envelope.heartbeat());
    case proto::Envelope::kHeartbeatAck:
      return read(envelope.heartbeat_ack());
    case proto::Envelope::kBye:
      return read(envelope.bye());
    case proto::Envelope::kDrain:
      return read(envelope.drain());
    case proto::Envelope::kStop:
      return read(envelope.stop());
    case proto::Envelope::MESSAGE_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

}  // namespace proofmass::wire::detail
