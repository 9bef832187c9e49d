#include "proto/wire/codec.hpp"

#include <google/protobuf/arena.h>

#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include "proto/wire/checks.hpp"

namespace proofmass::wire {
namespace {

/// The largest batch of results has 40,000 fields.
constexpr detail::Form message_form{.name = "message",
                                    .kind = "an envelope",
                                    .size_max = message_size_max,
                                    .fields_max = 65536,
                                    .is_always_counted = false};

/// Why the bytes are not a message, if so.
std::optional<DecodeError> read(std::string_view bytes, proto::Envelope& envelope) {
  auto fault = detail::parse(bytes, message_form, envelope);
  if (!fault) fault = detail::fault_in(envelope);
  if (!fault && envelope.has_reject()) {
    envelope.mutable_reject()->set_text(detail::printable(envelope.reject().text()));
  }
  return fault;
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
  constexpr std::size_t size_max = router_message_size_max - 1024;  // Room for the envelope.
  constexpr std::size_t frame_size = 8;                             // Of a result, at most.
  const auto& [campaign, attempt, computed] = result;
  proto::ComputedRun run;
  write_run(computed, run);
  const std::size_t size = run.ByteSizeLong() + frame_size;
  auto& [batch, batch_size] = open_[{campaign, attempt}];
  const bool is_full = batch_size + size > size_max ||
                       static_cast<std::size_t>(batch.results_size()) == runs_per_lease_max;
  if (is_full && batch.results_size() > 0) {
    full_.push_back(std::exchange(batch, {}));
    batch_size = 0;
  }
  batch.set_campaign(campaign.value);
  batch.set_attempt(attempt.value);
  *batch.add_results() = std::move(run);
  batch_size += size;
}

std::vector<proto::ResultBatch> ResultBatches::take() {
  for (auto& [key, open] : open_) full_.push_back(std::move(open.batch));
  return std::move(full_);
}

proto::Envelope rejection(proto::RejectReason reason, std::string_view text) {
  proto::Envelope envelope;
  envelope.mutable_reject()->set_reason(reason);
  envelope.mutable_reject()->set_text(std::string(text));
  return envelope;
}

}  // namespace proofmass::wire
