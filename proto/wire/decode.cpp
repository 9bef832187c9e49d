#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/campaign_codec.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

constexpr std::size_t reject_text_size_max = 4096;
constexpr double heartbeat_interval_s_max = 3600.0;

// Readers throw ConfigError at a forbidden value; decode() turns that into a DecodeError.

void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule) {
  if (!condition) throw ConfigError(field, value, rule);
}

void require_in(std::uint64_t value, std::uint64_t minimum, std::uint64_t maximum,
                std::string_view field) {
  require(value >= minimum && value <= maximum, field, fmt::format("{}", value),
          fmt::format("must be in [{}, {}]", minimum, maximum));
}

void require_count(int count, std::uint64_t minimum, std::uint64_t maximum,
                   std::string_view field) {
  require(
      static_cast<std::uint64_t>(count) >= minimum && static_cast<std::uint64_t>(count) <= maximum,
      field, fmt::format("{} entries", count),
      fmt::format("must be in [{}, {}]", minimum, maximum));
}

std::string checked_name(const std::string& name, std::string_view field) {
  // The name itself is not repeated: it may hold anything.
  require(is_name(name), field, fmt::format("{} bytes", name.size()),
          "must be 1 to 128 of [A-Za-z0-9._-]");
  return name;
}

LeaseId checked_lease(std::uint64_t id) {
  require(id != 0, "lease_id", "0", "must not be 0");
  return {id};
}

Attempt checked_attempt(std::uint32_t attempt) {
  require(attempt != 0, "attempt", "0", "must not be 0");
  return {attempt};
}

RunIndex checked_run(std::uint64_t run) {
  require_in(run, 0, num_runs_max - 1, "run");
  return {run};
}

double checked_duration_s(double value, std::string_view field) {
  require(std::isfinite(value) && value >= 0.0, field, fmt::format("{}", value), "must be >= 0");
  return value;
}

Message read(const proto::Hello& message) {
  require_in(message.num_slots(), 1, slots_max, "num_slots");
  return Hello{.worker_name = checked_name(message.worker_name(), "worker_name"),
               .host = checked_name(message.host(), "host"),
               .process_id = message.process_id(),
               .num_slots = message.num_slots(),
               .model_version = checked_name(message.model_version(), "model_version")};
}

Message read(const proto::Welcome& message) {
  require(message.worker_id() != 0, "worker_id", "0", "must not be 0");
  const double interval_s = message.heartbeat_interval_s();
  require(interval_s > 0.0 && interval_s <= heartbeat_interval_s_max, "heartbeat_interval_s",
          fmt::format("{}", interval_s),
          fmt::format("must be in (0, {}]", heartbeat_interval_s_max));
  return Welcome{
      .worker = {message.worker_id()},
      .heartbeat_interval_s = interval_s,
      .campaign = std::make_shared<const Campaign>(detail::decode_campaign(message.campaign()))};
}

Message read(const proto::Reject& message) {
  const int reason = static_cast<int>(message.reason());
  require(reason >= 1 && reason <= 4, "reason", fmt::format("{}", reason), "must be in [1, 4]");
  require(message.text().size() <= reject_text_size_max, "text",
          fmt::format("{} bytes", message.text().size()),
          fmt::format("must be at most {}", reject_text_size_max));
  return Reject{.reason = static_cast<RejectReason>(reason), .text = message.text()};
}

Message read(const proto::Credit& message) {
  require_in(message.num_runs_max(), 0, runs_per_lease_max, "num_runs_max");
  return Credit{.num_runs_max = message.num_runs_max()};
}

Message read(const proto::RunLease& message) {
  require_in(message.num_runs(), 1, runs_per_lease_max, "num_runs");
  require_in(message.first_run(), 0, num_runs_max - message.num_runs(), "first_run");
  const auto& values = message.table_values();
  const auto num_runs = static_cast<int>(message.num_runs());
  require(values.size() % num_runs == 0 && values.size() / num_runs <= static_cast<int>(num_drawn),
          "table_values", fmt::format("{} entries", values.size()),
          fmt::format("must be the same number for each run, at most {}", num_drawn));
  const bool all_finite =
      std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  require(all_finite, "table_values", "not finite", "must be finite");
  return RunLease{.lease = checked_lease(message.lease_id()),
                  .runs = {.first = {message.first_run()}, .count = message.num_runs()},
                  .attempt = checked_attempt(message.attempt()),
                  .table_values = {values.begin(), values.end()}};
}

/// Ten finite values if they mean something, none if not.
template <typename Values>
ParameterArray read_parameters(const Values& values, bool meaningful, std::string_view field) {
  const int count = meaningful ? static_cast<int>(num_parameters) : 0;
  require(values.size() == count, field, fmt::format("{} entries", values.size()),
          fmt::format("must be {} with this status", count));
  ParameterArray parameters{};
  std::copy(values.begin(), values.end(), parameters.begin());
  for (const double value : parameters) {
    require(std::isfinite(value), field, fmt::format("{}", value), "must be finite");
  }
  return parameters;
}

ComputedRun read_run(const proto::ComputedRun& message) {
  const int status = static_cast<int>(message.status());
  require(status >= 1 && status <= 4, "status", fmt::format("{}", status), "must be in [1, 4]");
  RunResult result;
  result.run = checked_run(message.run());
  result.status = static_cast<RunStatus>(status);
  result.num_draws = message.num_draws();
  result.num_rounds = message.num_rounds();
  result.truth = read_parameters(message.truth(), result.has_truth(), "truth");
  result.estimate = read_parameters(message.estimate(), result.has_estimate(), "estimate");
  return {.result = result, .compute_s = checked_duration_s(message.compute_s(), "compute_s")};
}

Message read(const proto::ResultBatch& message) {
  require_count(message.results_size(), 1, runs_per_lease_max, "results");
  ResultBatch batch{.lease = checked_lease(message.lease_id()),
                    .attempt = checked_attempt(message.attempt()),
                    .results = {}};
  for (const auto& run : message.results()) batch.results.push_back(read_run(run));
  return batch;
}

Message read(const proto::ResultAck& message) {
  require_count(message.runs_size(), 1, runs_per_lease_max, "runs");
  ResultAck ack;
  for (const std::uint64_t run : message.runs()) ack.runs.push_back(checked_run(run));
  return ack;
}

Message read(const proto::Heartbeat& message) {
  require_count(message.lease_ids_size(), 0, leases_held_max, "lease_ids");
  Heartbeat heartbeat{.num_orbits_done = message.num_orbits_done(), .leases = {}};
  for (const std::uint64_t id : message.lease_ids()) heartbeat.leases.push_back(checked_lease(id));
  return heartbeat;
}

Message read_content(const proto::Envelope& envelope) {
  switch (envelope.message_case()) {
    case proto::Envelope::kHello:
      return read(envelope.hello());
    case proto::Envelope::kWelcome:
      return read(envelope.welcome());
    case proto::Envelope::kReject:
      return read(envelope.reject());
    case proto::Envelope::kCredit:
      return read(envelope.credit());
    case proto::Envelope::kRunLease:
      return read(envelope.run_lease());
    case proto::Envelope::kResultBatch:
      return read(envelope.result_batch());
    case proto::Envelope::kResultAck:
      return read(envelope.result_ack());
    case proto::Envelope::kHeartbeat:
      return read(envelope.heartbeat());
    case proto::Envelope::kHeartbeatAck:
      return HeartbeatAck{};
    case proto::Envelope::kBye:
      return Bye{};
    case proto::Envelope::kDrain:
      return Drain{};
    case proto::Envelope::kStop:
      return Stop{};
    case proto::Envelope::MESSAGE_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

/// Protobuf would write a line to standard error for what a peer sends.
void silence_protobuf() {
  static const auto former = google::protobuf::SetLogHandler(nullptr);
  (void)former;
}

/// Text for logs and for the peer, of which parts may come from that peer.
std::string printable(std::string_view text) {
  constexpr std::size_t length_max = 400;
  std::string result(text.substr(0, length_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

DecodeError too_large(std::size_t size, std::size_t size_max) {
  return {DecodeFault::too_large,
          fmt::format("message size = {} bytes (must be at most {})", size, size_max)};
}

DecodeError wrong_version(std::uint32_t version) {
  return {DecodeFault::wrong_version,
          fmt::format("protocol_version = {} (must be {})", version, protocol_version)};
}

}  // namespace

std::variant<Message, DecodeError> decode(std::string_view bytes) {
  silence_protobuf();
  if (bytes.size() > welcome_size_max) return too_large(bytes.size(), welcome_size_max);
  proto::Envelope envelope;
  if (!envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return DecodeError{DecodeFault::unparsable,
                       fmt::format("message = {} bytes (must be an envelope)", bytes.size())};
  }
  if (envelope.protocol_version() != protocol_version) {
    return wrong_version(envelope.protocol_version());
  }
  if (envelope.message_case() == proto::Envelope::MESSAGE_NOT_SET) {
    return DecodeError{DecodeFault::empty, "message = none (must be of a known kind)"};
  }
  if (!envelope.has_welcome() && bytes.size() > message_size_max) {
    return too_large(bytes.size(), message_size_max);
  }
  try {
    return read_content(envelope);
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, printable(error.what())};
  }
}

}  // namespace proofmass::wire
