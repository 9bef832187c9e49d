#include "proto/wire/codec.hpp"

#include <fmt/format.h>
#include <google/protobuf/arena.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>

#include "core/error.hpp"
#include "proto/wire/checks.hpp"

namespace proofmass::wire {
namespace {

/// The largest batch of results has 40,000 fields.
constexpr detail::Form message_form{.name = "message",
                                    .kind = "an envelope",
                                    .size_max = message_size_max,
                                    .fields_max = 65536,
                                    .is_always_counted = false};

using detail::require;
using detail::require_count;
using detail::require_id;
using detail::require_in;
using detail::require_magnitude;
using detail::require_name;

void check_campaign(std::uint64_t id) { require_id(id, "campaign"); }
void check_attempt(std::uint32_t attempt) { require_id(attempt, "attempt"); }
void check_run(std::uint64_t run) { require_in(run, 0, num_runs_max - 1, "run"); }
void check_ranges(const Ranges& ranges) {
  require_count(ranges.size(), 1, ranges_per_message_max, "ranges");
  for (const proto::Range& range : ranges) {
    require_in(range.count(), 1, num_runs_max, "range count");
    require_in(range.first(), 0, num_runs_max - range.count(), "range first");
  }
}

/// @param num_ranges  Of the message so far; grows.
void check_held(const proto::HeldRuns& held, int& num_ranges) {
  check_campaign(held.campaign());
  check_attempt(held.attempt());
  check_ranges(held.ranges());
  num_ranges += held.ranges_size();
  require_in(static_cast<std::uint64_t>(num_ranges), 0, ranges_per_message_max, "number of ranges");
}

void check_reason(proto::LossReason value, std::initializer_list<LossReason> allowed) {
  require(std::ranges::find(allowed, loss_reason(value)) != allowed.end(), "reason",
          fmt::format("{}", static_cast<int>(value)), "must be one that this message may give");
}

void check(const proto::Hello& hello) {
  require_in(hello.num_slots(), 1, slots_max, "num_slots");
  require_in(hello.num_card_slots(), 0, hello.num_slots() - 1, "num_card_slots");
  detail::require_cards(hello.cards());
  require_name(hello.worker_name(), "worker_name");
  require_name(hello.host(), "host");
  require_name(hello.model_version(), "model_version");
  require_name(hello.build(), "build");
  require_in(hello.slots_per_thread(), 0, hello.num_slots() - hello.num_card_slots(),
             "slots_per_thread");
  require_count(hello.other_models_size(), 0, other_models_max, "other_models");
  for (const proto::OtherModel& other : hello.other_models()) {
    require_name(other.version(), "other_models.version");
  }
  if (!hello.has_former()) return;
  require_in(hello.former().signal(), 0, signal_max, "former signal");
  require_id(hello.former().session(), "former session");
  check_reason(hello.former().reason(),
               {LossReason::crashed, LossReason::out_of_memory, LossReason::preempted});
}

void check(const proto::Welcome& welcome) {
  const double interval_s = welcome.heartbeat_interval_s();
  require(interval_s > 0.0 && interval_s <= heartbeat_interval_s_max, "heartbeat_interval_s",
          fmt::format("{}", interval_s),
          fmt::format("must be in (0, {}]", heartbeat_interval_s_max));
  require_id(welcome.worker_id(), "worker_id");
}

void check(const proto::Reject& reject) {
  require(proto::RejectReason_IsValid(reject.reason()) &&
              reject.reason() != proto::REJECT_REASON_UNSPECIFIED,
          "reason", fmt::format("{}", static_cast<int>(reject.reason())),
          fmt::format("must be in [1, {}]", static_cast<int>(proto::RejectReason_MAX)));
  require(reject.text().size() <= reject_text_size_max, "text",
          fmt::format("{} bytes", reject.text().size()),
          fmt::format("must be at most {}", reject_text_size_max));
}

void check(const proto::CampaignRequest& request) {
  require_in(request.offset(), 0, definition_size_max - 1, "offset");
  check_campaign(request.campaign());
}

void check(const proto::DefinitionPart& part) {
  require_in(part.total_size(), 1, definition_size_max, "total_size");
  require_in(part.content().size(), 1,
             std::min<std::uint64_t>(definition_part_size_max, part.total_size()), "content size");
  require_in(part.offset(), 0, part.total_size() - part.content().size(), "offset");
  check_campaign(part.campaign());
}

void check(const proto::Forget& forget) {
  require_in(forget.num_runs(), 1, num_runs_max, "num_runs");
  check_campaign(forget.campaign());
}

void check(const proto::NotServed& not_served) {
  check_campaign(not_served.campaign());
  if (not_served.ranges_size() > 0) check_ranges(not_served.ranges());
}

void check(const proto::RunLease& lease) {
  require_in(lease.num_runs(), 1, runs_per_lease_max, "num_runs");
  require_in(lease.first_run(), 0, num_runs_max - lease.num_runs(), "first_run");
  const auto& values = lease.table_values();
  const auto num_values = static_cast<std::uint64_t>(values.size());
  require(num_values % lease.num_runs() == 0 && num_values / lease.num_runs() <= table_columns_max,
          "table_values", fmt::format("{} entries", num_values),
          fmt::format("must be the same number for each run, at most {}", table_columns_max));
  const bool all_finite =
      std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  require(all_finite, "table_values", "not finite", "must be finite");
  check_campaign(lease.campaign());
  check_attempt(lease.attempt());
}

void check(const proto::Retract& retract) {
  check_campaign(retract.campaign());
  check_ranges(retract.ranges());
}

void check(const proto::GiveBack& give_back) {
  require_count(give_back.runs_size(), 1, ranges_per_message_max, "runs");
  check_reason(give_back.reason(),
               {LossReason::crashed, LossReason::retracted, LossReason::drained,
                LossReason::walltime, LossReason::preempted, LossReason::failed});
  int num_ranges = 0;
  for (const proto::HeldRuns& held : give_back.runs()) check_held(held, num_ranges);
}

using Values = google::protobuf::RepeatedField<double>;

/// Values in range; none if they have no meaning. How many there are depends on the campaign, see
/// broken_size_rules().
void check_values(const Values& values, bool have_meaning, double least, double most,
                  std::string_view field) {
  require(have_meaning || values.empty(), field, fmt::format("{} entries", values.size()),
          "must be 0 with this status");
  for (const double value : values) {
    if (value >= least && value <= most) continue;
    throw ConfigError(field, fmt::format("{}", value),
                      fmt::format("must be in [{}, {}]", least, most));
  }
}

void check_loss(std::uint32_t position, bool is_lost, std::string_view field) {
  constexpr std::uint64_t positions_max = 255;
  require_in(position, is_lost ? 1 : 0, is_lost ? positions_max : 0, field);
}

void check(const proto::ComputedRun& run) {
  require_in(static_cast<std::uint64_t>(static_cast<int>(run.status())), 1, proto::RunStatus_MAX,
             "status");
  check_run(run.run());
  RunResult result;
  result.status = static_cast<RunStatus>(run.status());
  const bool has_truth = result.has_truth();
  const bool has_estimate = result.has_estimate();
  const bool has_errors = has_estimate && run.standard_error_size() > 0;
  check_values(run.truth(), has_truth, -magnitude_max, magnitude_max, "truth");
  check_values(run.estimate(), has_estimate, -magnitude_max, magnitude_max, "estimate");
  check_values(run.standard_error(), has_estimate, -magnitude_max, magnitude_max, "standard_error");
  check_values(run.health(), has_truth, 0.0, magnitude_max, "health");
  check_values(run.fit(), has_errors, 0.0, magnitude_max, "fit");
  check_values(run.correlation(), has_errors, -1.0, 1.0, "correlation");
  check_loss(run.loss_cause(), result.status == RunStatus::lost, "loss_cause");
  check_loss(run.loss_session(), result.status == RunStatus::lost, "loss_session");
  require_magnitude(run.compute_s(), "compute_s", run_time_s_max);
  require_magnitude(run.elapsed_s(), "elapsed_s", run_time_s_max);
}

void check(const proto::ResultBatch& batch) {
  require_count(batch.results_size(), 1, runs_per_lease_max, "results");
  check_campaign(batch.campaign());
  check_attempt(batch.attempt());
  for (const proto::ComputedRun& run : batch.results()) check(run);
}

void check(const proto::ResultAck& ack) {
  require_count(ack.runs_size(), 1, runs_per_lease_max, "runs");
  check_campaign(ack.campaign());
  for (const std::uint64_t run : ack.runs()) check_run(run);
}

void check(const proto::Heartbeat& heartbeat) {
  require_in(heartbeat.num_runs_max(), 0, runs_held_max, "num_runs_max");
  require_count(heartbeat.held_size(), 0, ranges_per_message_max, "held");
  require_count(heartbeat.set_aside_size(), 0, ranges_per_message_max, "set_aside");
  require_count(heartbeat.computing_size(), 0, ranges_per_message_max, "computing");
  int num_held = 0;
  for (const proto::HeldRuns& held : heartbeat.held()) check_held(held, num_held);
  for (const proto::HeldRuns& held : heartbeat.set_aside()) check_held(held, num_held);
  int num_computing = 0;
  for (const proto::ComputedBatch& batch : heartbeat.computing()) {
    check_campaign(batch.campaign());
    check_ranges(batch.ranges());
    num_computing += batch.ranges_size();
    require_in(static_cast<std::uint64_t>(num_computing), 0, ranges_per_message_max,
               "number of ranges");
  }
}

void check(const proto::Bye& bye) {
  check_reason(bye.reason(), {LossReason::drained, LossReason::walltime, LossReason::preempted,
                              LossReason::failed});
}

void check_of_worker(const proto::Envelope& envelope) {
  switch (envelope.from_worker_case()) {
    case proto::Envelope::kHello:
      return check(envelope.hello());
    case proto::Envelope::kCampaignRequest:
      return check(envelope.campaign_request());
    case proto::Envelope::kGiveBack:
      return check(envelope.give_back());
    case proto::Envelope::kResultBatch:
      return check(envelope.result_batch());
    case proto::Envelope::kHeartbeat:
      return check(envelope.heartbeat());
    case proto::Envelope::kBye:
      return check(envelope.bye());
    case proto::Envelope::FROM_WORKER_NOT_SET:
      return;
  }
}

void check_of_coordinator(const proto::Envelope& envelope) {
  switch (envelope.from_coordinator_case()) {
    case proto::Envelope::kWelcome:
      return check(envelope.welcome());
    case proto::Envelope::kReject:
      return check(envelope.reject());
    case proto::Envelope::kDefinitionPart:
      return check(envelope.definition_part());
    case proto::Envelope::kForget:
      return check(envelope.forget());
    case proto::Envelope::kNotServed:
      return check(envelope.not_served());
    case proto::Envelope::kRunLease:
      return check(envelope.run_lease());
    case proto::Envelope::kRetract:
      return check(envelope.retract());
    case proto::Envelope::kResultAck:
      return check(envelope.result_ack());
    case proto::Envelope::kHeartbeatAck:
    case proto::Envelope::kDrain:
    case proto::Envelope::kStop:
    case proto::Envelope::FROM_COORDINATOR_NOT_SET:
      return;
  }
}

/// Whether the message in the envelope is one that a peer may send: numbers and sizes are within
/// their limits, enumerators are known, names are names, lists have as many entries as others say.
/// @throws ConfigError reading `field = value (rule)`.
void check(const proto::Envelope& envelope) {
  require_id(envelope.session(), "session");
  require(!is_of_worker(envelope) || !is_of_coordinator(envelope), "message", "two", "must be one");
  check_of_worker(envelope);
  check_of_coordinator(envelope);
}

/// Why the bytes are not a message, if so.
std::optional<DecodeError> read(std::string_view bytes, proto::Envelope& envelope) {
  return detail::read(bytes, message_form, envelope, [&]() -> std::optional<DecodeError> {
    const bool is_empty = !is_of_worker(envelope) && !is_of_coordinator(envelope);
    const auto fault =
        detail::fault_of_envelope(message_form, envelope.protocol_version(), is_empty);
    if (fault) return fault;
    check(envelope);
    if (envelope.has_reject()) {
      envelope.mutable_reject()->set_text(detail::printable(envelope.reject().text()));
    }
    return std::nullopt;
  });
}

}  // namespace

std::variant<proto::Envelope, DecodeError> decode(std::string_view bytes) {
  proto::Envelope envelope;
  if (auto error = read(bytes, envelope)) return *std::move(error);
  return envelope;
}

std::variant<const proto::Envelope*, DecodeError> decode(std::string_view bytes,
                                                         google::protobuf::Arena& arena) {
  auto* const envelope = google::protobuf::Arena::CreateMessage<proto::Envelope>(&arena);
  if (auto error = read(bytes, *envelope)) return *std::move(error);
  return envelope;
}

std::string encode(proto::Envelope envelope) {
  return detail::envelope_bytes(envelope, message_form);
}

std::vector<RunRange> ranges_of(const Ranges& ranges) {
  std::vector<RunRange> values;
  values.reserve(static_cast<std::size_t>(ranges.size()));
  for (const proto::Range& range : ranges) {
    values.push_back({.first = {range.first()}, .count = range.count()});
  }
  return values;
}

void add_ranges(std::span<const RunRange> ranges, Ranges& message) {
  for (const RunRange& range : ranges) {
    proto::Range& added = *message.Add();
    added.set_first(range.first.value);
    added.set_count(range.count);
  }
}

RunRange runs_of(const proto::RunLease& lease) {
  return {.first = {lease.first_run()}, .count = lease.num_runs()};
}

std::vector<RunIndex> runs_of(const proto::ResultAck& ack) {
  std::vector<RunIndex> runs;
  runs.reserve(static_cast<std::size_t>(ack.runs_size()));
  for (const std::uint64_t run : ack.runs()) runs.push_back({run});
  return runs;
}

ComputedRun computed_run(const proto::ComputedRun& message) {
  RunResult result;
  result.run = {message.run()};
  result.status = static_cast<RunStatus>(message.status());
  result.num_draws = message.num_draws();
  result.num_rounds = message.num_rounds();
  result.truth.assign(message.truth().begin(), message.truth().end());
  result.estimate.assign(message.estimate().begin(), message.estimate().end());
  result.standard_error.assign(message.standard_error().begin(), message.standard_error().end());
  result.fit.assign(message.fit().begin(), message.fit().end());
  result.correlations.assign(message.correlation().begin(), message.correlation().end());
  result.health.assign(message.health().begin(), message.health().end());
  result.loss = {.cause = message.loss_cause(), .session = message.loss_session()};
  return {.result = std::move(result),
          .compute_s = message.compute_s(),
          .elapsed_s = message.elapsed_s(),
          .is_by_card = message.is_by_card()};
}

void write_run(const ComputedRun& computed, proto::ComputedRun& message) {
  const RunResult& result = computed.result;
  message.set_run(result.run.value);
  message.set_status(static_cast<proto::RunStatus>(result.status));
  message.set_num_draws(result.num_draws);
  message.set_num_rounds(result.num_rounds);
  if (result.has_truth()) {
    message.mutable_truth()->Assign(result.truth.begin(), result.truth.end());
    message.mutable_health()->Assign(result.health.begin(), result.health.end());
  }
  if (result.has_estimate()) {
    message.mutable_estimate()->Assign(result.estimate.begin(), result.estimate.end());
    message.mutable_standard_error()->Assign(result.standard_error.begin(),
                                             result.standard_error.end());
    message.mutable_fit()->Assign(result.fit.begin(), result.fit.end());
    message.mutable_correlation()->Assign(result.correlations.begin(), result.correlations.end());
  }
  message.set_loss_cause(result.loss.cause);
  message.set_loss_session(result.loss.session);
  message.set_compute_s(computed.compute_s);
  message.set_elapsed_s(computed.elapsed_s);
  message.set_is_by_card(computed.is_by_card);
}

void ResultBatches::add(const LeasedResult& result) {
  const auto& [campaign, attempt, computed] = result;
  proto::ResultBatch& batch = open_[{campaign, attempt}];
  batch.set_campaign(campaign.value);
  batch.set_attempt(attempt.value);
  proto::ComputedRun& run = *batch.add_results();
  write_run(computed, run);
  // Results of one campaign are about as large as each other; half of a message is left for that.
  const std::size_t count_max = std::clamp(message_size_max / 2 / run.ByteSizeLong(),
                                           std::size_t{1}, std::size_t{runs_per_lease_max});
  if (static_cast<std::size_t>(batch.results_size()) < count_max) return;
  full_.push_back(std::move(batch));
  open_.erase({campaign, attempt});
}

std::vector<proto::ResultBatch> ResultBatches::take() {
  for (auto& [key, batch] : open_) full_.push_back(std::move(batch));
  return std::move(full_);
}

proto::Envelope rejection(proto::RejectReason reason, std::string_view text) {
  proto::Envelope envelope;
  envelope.mutable_reject()->set_reason(reason);
  envelope.mutable_reject()->set_text(std::string(text));
  return envelope;
}

}  // namespace proofmass::wire
