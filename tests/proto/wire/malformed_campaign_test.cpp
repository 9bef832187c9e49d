// What a peer may not send as a campaign: each rule of the decoder, broken by one change.

#include <functional>
#include <stdexcept>

#include "proto/wire/definition_codec.hpp"
#include "tests/proto/wire/refusal.hpp"

namespace proofmass::wire {
namespace {

using test::nan;

std::string refusal_of_campaign(const std::function<void(proto::Campaign&)>& change) {
  proto::Campaign campaign;
  EXPECT_TRUE(campaign.ParseFromString(encode_definition(Campaign{})));
  change(campaign);
  const auto decoded = decode_definition(campaign.SerializeAsString());
  const auto* const error = std::get_if<DecodeError>(&decoded);
  if (error == nullptr) return "accepted";
  EXPECT_EQ(error->fault, DecodeFault::invalid);
  return error->text;
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

TEST(MalformedEnvelope, CannotPutControlCharactersIntoTheLog) {
  const std::string text =
      refusal_of_campaign([](auto& campaign) { campaign.mutable_fields(0)->set_path("a\nb\x1b"); });
  EXPECT_EQ(text.find_first_of("\n\x1b"), std::string::npos);
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
            "session.target = 0 (must be an enumerator, 1 to 12)");
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
