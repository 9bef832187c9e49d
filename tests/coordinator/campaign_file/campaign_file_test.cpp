#include "coordinator/campaign_file/campaign_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/campaign_file/scratch_folder.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

MicroscopeCampaign campaign_of(std::string_view text, const Overrides& overrides = {}) {
  const test::ScratchFolder folder;
  return test::microscope(*test::campaign_of_text(text, folder, overrides));
}

TEST(ReadCampaign, CompletesAFileThatHasANameAloneWithTheNominalValues) {
  const MicroscopeCampaign campaign = campaign_of("campaign.name = \"hardy2013\"");
  EXPECT_THAT(definition_differences(campaign, hardy2013_campaign()), IsEmpty());
  EXPECT_EQ(campaign.num_runs, 100u);
  EXPECT_EQ(campaign.scenario.estimation.correction, Correction::hardy2013);
}

TEST(ReadCampaign, TakesEveryKindOfValue) {
  const MicroscopeCampaign campaign = campaign_of(R"(
    [campaign]
    name = "mine"
    seed = 9223372036854775807
    runs = 7
    [noise]
    scale = 0
    thrust_asd_m_s2 = 1e-300
    [environment.linear_x]
    mean_m_s2 = 0.1
    [estimation]
    correction = "first_order"
    num_rounds_max = 3
  )");
  EXPECT_EQ(campaign.name, "mine");
  EXPECT_EQ(campaign.seed, 9223372036854775807u);
  EXPECT_EQ(campaign.num_runs, 7u);
  EXPECT_EQ(campaign.scenario.noise.scale, 0.0);
  EXPECT_EQ(campaign.scenario.noise.thrust_asd_m_s2, 1e-300);
  EXPECT_EQ(campaign.scenario.environment.linear_x.mean, 0.1);
  EXPECT_EQ(campaign.scenario.estimation.correction, Correction::first_order);
  EXPECT_EQ(campaign.scenario.estimation.num_rounds_max, 3);
}

TEST(ReadCampaign, AppliesThePresetBeforeTheOtherKeysOfNoise) {
  const MicroscopeCampaign campaign = campaign_of(R"(
    [noise.linear_x]
    white_asd_m_s2 = 1e-12
    [noise]
    preset = "flight_suref"
  )");
  EXPECT_EQ(campaign.scenario.noise.preset, NoisePreset::flight_suref);
  EXPECT_EQ(campaign.scenario.noise.linear_x.white_asd, 1e-12);
  EXPECT_EQ(campaign.scenario.noise.linear_x.pink_corner_hz, 7.33e-3);
  EXPECT_EQ(campaign.scenario.noise.linear_yz.white_asd, 2.245e-11);
}

TEST(ReadCampaign, TakesSessionsInTheOrderOfTheFile) {
  MicroscopeCampaign reversed = hardy2013_campaign();
  std::ranges::reverse(reversed.scenario.sessions);
  const MicroscopeCampaign campaign = campaign_of(commented_campaign(reversed));
  EXPECT_EQ(campaign.scenario.sessions, reversed.scenario.sessions);
}

TEST(ReadCampaign, LetsAnElementOverrideItsGroup) {
  const MicroscopeCampaign campaign = campaign_of(R"(
    [dispersion.offcentring_m]
    minimum = -1e-6
    [dispersion.offcentring_m.y]
    law = "truncated_normal"
    mean = 0
    standard_deviation = 1e-6
    minimum = -3e-6
    maximum = 3e-6
    [dispersion.offcentring_m.z]
    maximum = 5e-6
    [dispersion.misalignment_rad]
    law = "fixed"
    value = 0.001
    sensor_2_z = { law = "normal", mean = 1e-3, standard_deviation = 1e-4 }
  )");
  const Dispersion& x = campaign.dispersions[24];
  EXPECT_EQ(x.law, Law::uniform);
  EXPECT_EQ(x.minimum, -1e-6);
  EXPECT_EQ(x.maximum, 20e-6);
  const Dispersion& y = campaign.dispersions[25];
  EXPECT_EQ(y.law, Law::truncated_normal);
  EXPECT_EQ(y.standard_deviation, 1e-6);
  EXPECT_EQ(y.maximum, 3e-6);
  const Dispersion& z = campaign.dispersions[26];
  EXPECT_EQ(z.minimum, -1e-6);
  EXPECT_EQ(z.maximum, 5e-6);
  EXPECT_EQ(campaign.dispersions[6].value, 0.001);
  EXPECT_EQ(campaign.dispersions[6].minimum, 0.0);
  EXPECT_EQ(campaign.dispersions[11].law, Law::normal);
  EXPECT_EQ(campaign.dispersions[11].mean, 1e-3);
}

TEST(ReadCampaign, ReadsDataFilesBesideTheCampaignFile) {
  const test::ScratchFolder folder;
  folder.write("env.csv",
               "time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,"
               "angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2\n"
               "0,1,2,3,4,5,6\n6000,1,2,3,4,5,6\n");
  folder.write("draws.csv", "a,b\n0.01,1\n0.02,2\n0.005,3\n");
  const MicroscopeCampaign campaign =
      test::microscope(*read_campaign(folder.write("campaign.toml", R"(
    campaign = { name = "tables", runs = 3 }
    [environment]
    kind = "file"
    file = "env.csv"
    [dispersion.offcentring_m]
    z = { law = "table", file = "draws.csv", column = "a" }
    [dispersion.scale_factor_error.sensor_1_x]
    law = "table"
    file = "draws.csv"
    column = "b"
  )")));
  ASSERT_EQ(campaign.environment_table.size(), 2u);
  EXPECT_EQ(campaign.environment_table[1].time_s, 6000.0);
  EXPECT_THAT(campaign.table_columns,
              ElementsAre(ElementsAre(1, 2, 3), ElementsAre(0.01, 0.02, 0.005)));
  EXPECT_THAT(campaign.table_values(RunIndex{2}), ElementsAre(3, 0.005));
}

TEST(Overrides, WinOverTheFile) {
  const Overrides overrides{
      .assignments = {"noise.scale=0.25", "estimation.correction=first_order",
                      "campaign.name=\"quoted\"", "dispersion.offcentring_m.x.maximum=1e-6"},
      .num_runs = 12,
      .seed = 34};
  const MicroscopeCampaign campaign = campaign_of("campaign.runs = 3\nnoise.scale = 9", overrides);
  EXPECT_EQ(campaign.scenario.noise.scale, 0.25);
  EXPECT_EQ(campaign.scenario.estimation.correction, Correction::first_order);
  EXPECT_EQ(campaign.name, "quoted");
  EXPECT_EQ(campaign.num_runs, 12u);
  EXPECT_EQ(campaign.seed, 34u);
  EXPECT_EQ(campaign.dispersions[24].maximum, 1e-6);
}

TEST(Overrides, AreRefusedByTheirOwnText) {
  const auto refusal = [](std::string assignment) {
    return test::refusal_of("", {.assignments = {std::move(assignment)}});
  };
  EXPECT_EQ(refusal("noise.scal=0"), "--set noise.scal=0: unknown key; nearest is noise.scale");
  EXPECT_EQ(refusal("noise.scale=-1"), "--set noise.scale=-1: must be >= 0");
  EXPECT_EQ(refusal("noise.scale=loud"), "--set noise.scale=loud: must be a number");
  EXPECT_EQ(refusal("noise.scale="), "--set noise.scale=: must be a number");
  EXPECT_EQ(refusal("noise.scale"), "--set noise.scale: must be key=value");
  EXPECT_EQ(refusal("=1"), "--set =1: must be key=value");
  EXPECT_EQ(refusal("noise=1"), "--set noise=1: unknown key");
  EXPECT_EQ(refusal("estimation.correction=third"),
            "--set estimation.correction=third: must be \"first_order\", \"second_order\" or "
            "\"hardy2013\"");
  EXPECT_EQ(refusal("estimation.transient_s=60000"),
            "--set estimation.transient_s=60000: estimation.transient_s = 60000 (must leave half "
            "of session[0], 59500 s)");
  EXPECT_EQ(refusal("noise.scale=1\nnoise.preset = \"flight_suref\""),
            "--set noise.scale=1\nnoise.preset = \"flight_suref\": must be a number");
}

// The law of the file is gone with its keys; what both have, and the centre, stays.
TEST(ReadCampaign, ReplacesALawByOneThatIsSet) {
  const std::string_view file = R"(
    [dispersion.offcentring_m]
    minimum = 1e-6
    maximum = 3e-6
    y = { maximum = 5e-6 }
    z = { law = "normal", mean = 4e-6, standard_deviation = 1e-6 }
    [dispersion.coupling_rad]
    law = "truncated_normal"
    mean = 1e-5
    standard_deviation = 1e-5
    minimum = 0
    maximum = 3e-5)";
  const auto laws = [&](std::vector<std::string> assignments) {
    return campaign_of(file, {.assignments = std::move(assignments)}).dispersions;
  };
  const auto fixed = [](double value) {
    Dispersion law;
    law.law = Law::fixed;
    law.value = value;
    return law;
  };
  DispersionSet dispersions = laws({"dispersion.offcentring_m.law=fixed"});
  EXPECT_EQ(dispersions[24], fixed(2e-6));
  EXPECT_EQ(dispersions[25], fixed(2e-6));
  EXPECT_EQ(dispersions[26].law, Law::normal);
  dispersions =
      laws({"dispersion.offcentring_m.z.law=fixed", "dispersion.offcentring_m.y.law=fixed",
            "dispersion.offcentring_m.y.value=7e-6", "dispersion.coupling_rad.law=normal"});
  EXPECT_EQ(dispersions[24].law, Law::uniform);
  EXPECT_EQ(dispersions[25], fixed(7e-6));
  EXPECT_EQ(dispersions[26], fixed(4e-6));
  EXPECT_EQ(dispersions[12].law, Law::normal);
  EXPECT_EQ(dispersions[12].mean, 1e-5);
  EXPECT_EQ(dispersions[12].standard_deviation, 1e-5);
  EXPECT_EQ(dispersions[12].maximum, 0.0);
  EXPECT_EQ(laws({"dispersion.coupling_rad.law=uniform"})[12].maximum, 3e-5);
  EXPECT_EQ(laws({"dispersion.offcentring_m.law=uniform"}), laws({}));

  const auto refusal = [&](std::vector<std::string> assignments) {
    return test::refusal_of(file, {.assignments = std::move(assignments)});
  };
  EXPECT_EQ(refusal({"dispersion.offcentring_m.law=normal"}),
            "campaign.toml:2: dispersion.offcentring_m.standard_deviation is missing (law normal "
            "needs it: --set dispersion.offcentring_m.standard_deviation=...)");
  EXPECT_EQ(refusal({"dispersion.offcentring_m.law=fixed", "dispersion.offcentring_m.minimum=0"}),
            "--set dispersion.offcentring_m.minimum=0: not a key of law fixed, which has value");
}

TEST(Overrides, OfRunsAndSeedAreCheckedLikeTheFile) {
  EXPECT_EQ(test::refusal_of("", {.num_runs = 0}), "--runs 0: must be in [1, 1000000000]");
  EXPECT_EQ(test::refusal_of("", {.seed = 9223372036854775808u}),
            "--seed 9223372036854775808: must be in [0, 9223372036854775807]");
}

}  // namespace
}  // namespace proofmass::coordinator
