// What a peer may not send: each rule of the decoder, broken by one change of a good message.

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <variant>

#include "proto/proofmass.pb.h"
#include "proto/wire/codec.hpp"

namespace proofmass::wire {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

DecodeError refusal_of(const std::string& bytes) {
  const auto decoded = decode(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
}

/// Why the message is refused after the change.
std::string refusal(const Message& good, const std::function<void(proto::Envelope&)>& change) {
  proto::Envelope envelope;
  EXPECT_TRUE(envelope.ParseFromString(encode(good)));
  change(envelope);
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::invalid);
  return error.text;
}

const Hello good_hello{
    .worker_name = "w", .host = "h", .process_id = 1, .num_slots = 1, .model_version = "m"};
const RunLease good_lease{
    .lease = {1}, .runs = {.first = {0}, .count = 2}, .attempt = {1}, .table_values = {1.0, 2.0}};
const Welcome good_welcome{
    .worker = {1}, .heartbeat_interval_s = 1.0, .campaign = std::make_shared<const Campaign>()};
const ResultBatch good_batch{.lease = {1}, .attempt = {1}, .results = {ComputedRun{}}};

std::string refusal_of_hello(const std::function<void(proto::Hello&)>& change) {
  return refusal(good_hello, [&](auto& envelope) { change(*envelope.mutable_hello()); });
}
std::string refusal_of_lease(const std::function<void(proto::RunLease&)>& change) {
  return refusal(good_lease, [&](auto& envelope) { change(*envelope.mutable_run_lease()); });
}
std::string refusal_of_batch(const std::function<void(proto::ResultBatch&)>& change) {
  return refusal(good_batch, [&](auto& envelope) { change(*envelope.mutable_result_batch()); });
}
std::string refusal_of_run(const std::function<void(proto::ComputedRun&)>& change) {
  return refusal_of_batch([&](auto& batch) { change(*batch.mutable_results(0)); });
}
std::string refusal_of_welcome(const std::function<void(proto::Welcome&)>& change) {
  return refusal(good_welcome, [&](auto& envelope) { change(*envelope.mutable_welcome()); });
}
std::string refusal_of_campaign(const std::function<void(proto::Campaign&)>& change) {
  return refusal_of_welcome([&](auto& welcome) { change(*welcome.mutable_campaign()); });
}
std::string refusal_of_session(const std::function<void(proto::Session&)>& change) {
  return refusal_of_campaign([&](auto& campaign) { change(*campaign.mutable_sessions(0)); });
}

proto::Field& field_named(proto::Campaign& campaign, const std::string& path) {
  for (proto::Field& field : *campaign.mutable_fields()) {
    if (field.path() == path) return field;
  }
  throw std::out_of_range(path);
}

// Envelopes.

TEST(MalformedEnvelope, OfTooManyBytesIsNotParsed) {
  const DecodeError error = refusal_of(std::string(welcome_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "message size = 67108865 bytes (must be at most 67108864)");
}

TEST(MalformedEnvelope, MayBeLargeForAWelcomeOnly) {
  proto::Envelope envelope;
  envelope.set_protocol_version(protocol_version);
  envelope.mutable_reject()->set_reason(proto::REJECT_REASON_FULL);
  envelope.mutable_reject()->set_text(std::string(message_size_max, 'x'));
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "message size = 4194318 bytes (must be at most 4194304)");
}

TEST(MalformedEnvelope, ThatIsNoneIsUnparsable) {
  const DecodeError error = refusal_of("GET / HTTP/1.1");
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "message = 14 bytes (must be an envelope)");
}

TEST(MalformedEnvelope, OfAnotherVersionIsRefused) {
  proto::Envelope envelope;
  envelope.set_protocol_version(2);
  envelope.mutable_bye();
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::wrong_version);
  EXPECT_EQ(error.text, "protocol_version = 2 (must be 1)");
}

TEST(MalformedEnvelope, WithoutAMessageIsRefused) {
  proto::Envelope envelope;
  envelope.set_protocol_version(1);
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "message = none (must be of a known kind)");
}

TEST(MalformedEnvelope, CannotPutControlCharactersIntoTheLog) {
  const std::string text =
      refusal_of_campaign([](auto& campaign) { campaign.mutable_fields(0)->set_path("a\nb\x1b"); });
  EXPECT_EQ(text.find_first_of("\n\x1b"), std::string::npos);
}

// Hello, Reject, Credit, ResultAck, Heartbeat.

TEST(MalformedHello, HasNamesThatMayBeLogged) {
  EXPECT_EQ(refusal_of_hello([](auto& hello) { hello.set_worker_name("a b"); }),
            "worker_name = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-])");
  EXPECT_EQ(refusal_of_hello([](auto& hello) { hello.set_host(""); }),
            "host = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-])");
  EXPECT_EQ(refusal_of_hello([](auto& hello) { hello.set_model_version("\n"); }),
            "model_version = 1 bytes (must be 1 to 128 of [A-Za-z0-9._-])");
}

TEST(MalformedHello, HasSlots) {
  EXPECT_EQ(refusal_of_hello([](auto& hello) { hello.set_num_slots(0); }),
            "num_slots = 0 (must be in [1, 1024])");
  EXPECT_EQ(refusal_of_hello([](auto& hello) { hello.set_num_slots(1025); }),
            "num_slots = 1025 (must be in [1, 1024])");
}

TEST(MalformedReject, HasAKnownReasonAndABoundedText) {
  const Reject good{.reason = RejectReason::full, .text = ""};
  EXPECT_EQ(refusal(good, [](auto& envelope) { envelope.mutable_reject()->clear_reason(); }),
            "reason = 0 (must be in [1, 4])");
  EXPECT_EQ(
      refusal(good,
              [](auto& envelope) { envelope.mutable_reject()->set_text(std::string(4097, 'x')); }),
      "text = 4097 bytes (must be at most 4096)");
}

TEST(MalformedCredit, IsBounded) {
  EXPECT_EQ(refusal(Credit{.num_runs_max = 1},
                    [](auto& envelope) { envelope.mutable_credit()->set_num_runs_max(4097); }),
            "num_runs_max = 4097 (must be in [0, 4096])");
}

TEST(MalformedResultAck, NamesRuns) {
  const ResultAck good{.runs = {{1}}};
  EXPECT_EQ(refusal(good, [](auto& envelope) { envelope.mutable_result_ack()->clear_runs(); }),
            "runs = 0 entries (must be in [1, 4096])");
  EXPECT_EQ(
      refusal(good, [](auto& envelope) { envelope.mutable_result_ack()->add_runs(1'000'000'000); }),
      "run = 1000000000 (must be in [0, 999999999])");
}

TEST(MalformedHeartbeat, NamesAFewLeases) {
  EXPECT_EQ(refusal(Heartbeat{.num_orbits_done = 0, .leases = {}},
                    [](auto& envelope) { envelope.mutable_heartbeat()->add_lease_ids(0); }),
            "lease_id = 0 (must not be 0)");
  EXPECT_EQ(refusal(Heartbeat{.num_orbits_done = 0, .leases = {}},
                    [](auto& envelope) {
                      for (int i = 0; i < 4097; ++i) envelope.mutable_heartbeat()->add_lease_ids(1);
                    }),
            "lease_ids = 4097 entries (must be in [0, 4096])");
}

// RunLease.

TEST(MalformedRunLease, HasANumberAndAnAttempt) {
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_lease_id(0); }),
            "lease_id = 0 (must not be 0)");
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_attempt(0); }),
            "attempt = 0 (must not be 0)");
}

TEST(MalformedRunLease, HasRunsThatExist) {
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_num_runs(0); }),
            "num_runs = 0 (must be in [1, 4096])");
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_num_runs(4097); }),
            "num_runs = 4097 (must be in [1, 4096])");
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_first_run(999'999'999); }),
            "first_run = 999999999 (must be in [0, 999999998])");
}

TEST(MalformedRunLease, HasFiniteTableValuesForEachRun) {
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.add_table_values(1.0); }),
            "table_values = 3 entries (must be the same number for each run, at most 60)");
  EXPECT_EQ(refusal_of_lease([](auto& lease) { lease.set_table_values(0, nan); }),
            "table_values = not finite (must be finite)");
}

// ResultBatch.

TEST(MalformedResultBatch, HasLeaseAttemptAndResults) {
  EXPECT_EQ(refusal_of_batch([](auto& batch) { batch.set_lease_id(0); }),
            "lease_id = 0 (must not be 0)");
  EXPECT_EQ(refusal_of_batch([](auto& batch) { batch.set_attempt(0); }),
            "attempt = 0 (must not be 0)");
  EXPECT_EQ(refusal_of_batch([](auto& batch) { batch.clear_results(); }),
            "results = 0 entries (must be in [1, 4096])");
}

TEST(MalformedComputedRun, HasAStatusAndARunIndex) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.clear_status(); }),
            "status = 0 (must be in [1, 4])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_run(1'000'000'000); }),
            "run = 1000000000 (must be in [0, 999999999])");
}

TEST(MalformedComputedRun, HasTheNumbersThatItsStatusGives) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.clear_truth(); }),
            "truth = 0 entries (must be 10 with this status)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_status(proto::RUN_STATUS_NO_DRAW); }),
            "truth = 10 entries (must be 0 with this status)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_status(proto::RUN_STATUS_NOT_FINITE); }),
            "estimate = 10 entries (must be 0 with this status)");
}

TEST(MalformedComputedRun, HasFiniteNumbers) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_truth(3, nan); }),
            "truth = nan (must be finite)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_estimate(3, 1.0 / 0.0); }),
            "estimate = inf (must be finite)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_compute_s(-1.0); }),
            "compute_s = -1 (must be >= 0)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_compute_s(nan); }),
            "compute_s = nan (must be >= 0)");
}

// Welcome and the campaign in it.

TEST(MalformedWelcome, HasANumberAndAnInterval) {
  EXPECT_EQ(refusal_of_welcome([](auto& welcome) { welcome.set_worker_id(0); }),
            "worker_id = 0 (must not be 0)");
  for (const auto& [value, text] : {std::pair{0.0, "0"}, {nan, "nan"}, {3601.0, "3601"}}) {
    EXPECT_EQ(refusal_of_welcome([&](auto& welcome) { welcome.set_heartbeat_interval_s(value); }),
              std::string("heartbeat_interval_s = ") + text + " (must be in (0, 3600])");
  }
}

TEST(MalformedCampaign, HasRuns) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_num_runs(0); }),
            "num_runs = 0 (must be in [1, 1000000000])");
}

TEST(MalformedCampaign, HasEachFieldOnce) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              field_named(campaign, "noise.scale").set_path("noise.scal");
            }),
            "fields = noise.scale (must be there)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              *campaign.add_fields() = field_named(campaign, "noise.scale");
            }),
            "fields = noise.scale (must not be repeated)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.add_fields()->set_path("x.y"); }),
            "fields = x.y (unknown field)");
}

TEST(MalformedCampaign, HasFieldsOfTheirType) {
  const auto with = [](const std::string& path, const auto& change) {
    return refusal_of_campaign([&](auto& campaign) { change(field_named(campaign, path)); });
  };
  EXPECT_EQ(with("noise.scale", [](auto& field) { field.set_integer(1); }),
            "noise.scale = no number (must be a number)");
  EXPECT_EQ(with("noise.scale", [](auto& field) { field.set_number(nan); }),
            "noise.scale = nan (must be finite)");
  EXPECT_EQ(with("noise.scale", [](auto& field) { field.set_number(-1.0); }),
            "noise.scale = -1 (must be >= 0)");
  EXPECT_EQ(with("estimation.num_rounds_max", [](auto& field) { field.set_number(1.0); }),
            "estimation.num_rounds_max = no integer (must be an integer)");
  EXPECT_EQ(with("noise.preset", [](auto& field) { field.set_number(1.0); }),
            "noise.preset = no choice (must be a choice)");
  EXPECT_EQ(with("noise.preset", [](auto& field) { field.set_choice(3); }),
            "noise.preset = 3 (must be in [1, 2])");
  EXPECT_EQ(with("noise.preset", [](auto& field) { field.set_choice(0); }),
            "noise.preset = 0 (must be in [1, 2])");
}

TEST(MalformedCampaign, HasABoundedNumberOfEverything) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              for (int i = 0; i < 54; ++i) *campaign.add_sessions() = campaign.sessions(0);
            }),
            "sessions = 65 entries (must be at most 64)");
  EXPECT_EQ(refusal_of_session([](auto& session) {
              for (int i = 0; i < 17; ++i) session.add_excitations();
            }).substr(0, 19),
            "session.excitations");
  EXPECT_EQ(refusal_of_session([](auto& session) {
              session.clear_fit_lines();
              for (int i = 0; i < 65; ++i) session.add_fit_lines();
            }),
            "session.fit_lines = 65 entries (must be at most 64)");
  EXPECT_EQ(refusal_of_session([](auto& session) {
              session.clear_known_lines();
              for (int i = 0; i < 65; ++i) session.add_known_lines();
            }),
            "session.known_lines = 65 entries (must be at most 64)");
}

TEST(MalformedCampaign, HasSessionsOfKnownKinds) {
  EXPECT_EQ(refusal_of_session([](auto& session) { session.clear_target(); }),
            "session.target = 0 (must be an enumerator, 1 to 11)");
  EXPECT_EQ(refusal_of_session([](auto& session) { session.clear_drag_free(); }),
            "session.drag_free = 0 (must be an enumerator, 1 to 3)");
  EXPECT_EQ(refusal_of_session([](auto& session) { session.set_num_orbits(0); }),
            "session.num_orbits = 0 (must be in [1, 10000])");
  EXPECT_EQ(refusal_of_session([](auto& session) { session.set_spin_rate_rad_s(nan); }),
            "session.spin_rate_rad_s = nan (must be finite)");
  EXPECT_EQ(refusal_of_session([](auto& session) { session.add_fit_lines()->set_orbital(1001); }),
            "session.line = 1001 (must be within ??1000)");
}

TEST(MalformedCampaign, HasExcitationsOfKnownKinds) {
  const auto with = [](const std::function<void(proto::Excitation&)>& change) {
    return refusal_of_session([&](auto& session) {
      proto::Excitation& excitation = *session.add_excitations();
      excitation.set_kind(proto::EXCITATION_KIND_DRAG_FREE);
      excitation.set_axis(proto::AXIS_X);
      excitation.set_motion(proto::MASS_MOTION_OPPOSITION);
      change(excitation);
    });
  };
  EXPECT_EQ(with([](auto& excitation) { excitation.clear_kind(); }),
            "excitation.kind = 0 (must be an enumerator, 1 to 3)");
  EXPECT_EQ(with([](auto& excitation) { excitation.clear_axis(); }),
            "excitation.axis = 0 (must be an enumerator, 1 to 3)");
  EXPECT_EQ(with([](auto& excitation) { excitation.clear_motion(); }),
            "excitation.motion = 0 (must be an enumerator, 1 to 3)");
  EXPECT_EQ(with([](auto& excitation) { excitation.set_amplitude(nan); }),
            "excitation.amplitude = nan (must be finite)");
  EXPECT_EQ(with([](auto& excitation) { excitation.set_frequency_hz(nan); }),
            "excitation.frequency_hz = nan (must be finite)");
}

TEST(MalformedCampaign, HasTheDispersionsInTheirOrder) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.add_dispersions(); }),
            "dispersions = 61 entries (must be 60)");
  EXPECT_EQ(refusal_of_campaign(
                [](auto& campaign) { campaign.mutable_dispersions(0)->set_name("other"); }),
            "dispersions = other (must be scale_factor_error.sensor_1_x here)");
  EXPECT_EQ(
      refusal_of_campaign([](auto& campaign) { campaign.mutable_dispersions(0)->clear_law(); }),
      "dispersion.scale_factor_error.sensor_1_x.law = 0 (must be an enumerator, 1 to 5)");
}

TEST(MalformedCampaign, HasFiniteNumbersInItsDispersions) {
  const auto with = [](const std::function<void(proto::Dispersion&)>& change) {
    return refusal_of_campaign([&](auto& campaign) { change(*campaign.mutable_dispersions(0)); });
  };
  const std::string path = "dispersion.scale_factor_error.sensor_1_x.";
  EXPECT_EQ(with([](auto& law) { law.set_minimum(nan); }), path + "minimum = nan (must be finite)");
  EXPECT_EQ(with([](auto& law) { law.set_maximum(nan); }), path + "maximum = nan (must be finite)");
  EXPECT_EQ(with([](auto& law) { law.set_mean(nan); }), path + "mean = nan (must be finite)");
  EXPECT_EQ(with([](auto& law) { law.set_standard_deviation(nan); }),
            path + "standard_deviation = nan (must be finite)");
  EXPECT_EQ(with([](auto& law) { law.set_value(nan); }), path + "value = nan (must be finite)");
}

TEST(MalformedCampaign, HasWholeFiniteRowsOfEnvironmentIfAny) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.add_environment_values(1.0); }),
            "environment_values = 1 entries (must be rows of 7, at most 200000 rows)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              for (int i = 0; i < 7; ++i) campaign.add_environment_values(nan);
            }),
            "environment_values = nan (must be finite)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              for (int i = 0; i < 7; ++i) campaign.add_environment_values(0.0);
            }),
            "environment_values = 1 rows (must be there if environment.kind is file, and only "
            "then)");
}

TEST(MalformedCampaign, PassesTheRulesOfItsScenario) {
  const std::string text =
      refusal_of_campaign([](auto& campaign) { campaign.mutable_sessions(0)->set_name("a b"); });
  EXPECT_NE(text, "accepted");
}

}  // namespace
}  // namespace proofmass::wire
