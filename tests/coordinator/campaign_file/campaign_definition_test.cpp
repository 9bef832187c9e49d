#include "core/microscope/definition/campaign_definition.hpp"

#include "coordinator/campaign_file/campaign_file.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/parse_campaign.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

MicroscopeCampaign read_microscope(const std::filesystem::path& file,
                                   const Overrides& overrides = {}) {
  return test::microscope(*read_campaign(file, overrides));
}

// A campaign whose every part differs from the nominal one.
MicroscopeCampaign unusual_campaign() {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.name = "un-usual.2";
  campaign.seed = 9223372036854775807u;
  campaign.num_runs = 3;
  campaign.scenario.noise = noise_preset(NoisePreset::flight_suref);
  campaign.scenario.noise.linear_x.white_asd = 1.0 / 3e12;
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.scenario.estimation.num_rounds_max = 7;
  campaign.scenario.sessions[1].spin_rate_rad_s = 1e-3;
  campaign.scenario.sessions[1].num_orbits = 12;
  campaign.scenario.sessions[5].excitations[0].amplitude = 1.0 / 3e7;
  std::swap(campaign.scenario.sessions[0], campaign.scenario.sessions[10]);
  Session& shaken_twice = campaign.scenario.sessions[7];
  shaken_twice.excitations.push_back({ExcitationKind::attitude, Axis::z, 1e-3, 7e-4});
  shaken_twice.known_lines.push_back({.orbital = 1.0, .further = {2.5, 0.0, 0.0}});
  campaign.environment_file = "air \"thin\".csv";
  campaign.environment_table = {{0.0, {1, 2, 3}, {4, 5, 6}}, {6000.0, {1, 2, 3}, {4, 5, 6}}};
  const auto law = [](Law kind) {
    Dispersion dispersion;
    dispersion.law = kind;
    return dispersion;
  };
  campaign.dispersions[0] = law(Law::normal);
  campaign.dispersions[0].standard_deviation = 0.1;
  campaign.dispersions[1] = law(Law::truncated_normal);
  campaign.dispersions[1].minimum = -1.0;
  campaign.dispersions[1].maximum = 2.0;
  campaign.dispersions[1].mean = 0.5;
  campaign.dispersions[1].standard_deviation = 0.1;
  campaign.dispersions[7] = law(Law::fixed);
  campaign.dispersions[7].value = -0.0;
  campaign.dispersions[59] = law(Law::table);
  campaign.dispersions[59].file = "heads.csv";
  campaign.dispersions[59].column = "z2";
  campaign.table_columns = {{1.0, 2.0, 3.0, 4.0}};
  return campaign;
}

void expect_same(const MicroscopeCampaign& read, const MicroscopeCampaign& written) {
  EXPECT_EQ(read.name, written.name);
  EXPECT_EQ(read.seed, written.seed);
  EXPECT_EQ(read.num_runs, written.num_runs);
  EXPECT_EQ(read.environment_file, written.environment_file);
  EXPECT_EQ(read.environment_table, written.environment_table);
  EXPECT_EQ(read.table_columns, written.table_columns);
  EXPECT_EQ(read.scenario.sessions, written.scenario.sessions);
  EXPECT_EQ(read.dispersions, written.dispersions);
  EXPECT_EQ(read.scenario.noise.linear_x.white_asd, written.scenario.noise.linear_x.white_asd);
  EXPECT_EQ(read.scenario.estimation.correction, written.scenario.estimation.correction);
  EXPECT_THAT(definition_differences(read, written), IsEmpty());
}

// But one that came later, at its nominal value: the text of older campaigns remains what it was.
TEST(CanonicalDefinition, StatesEveryField) {
  MicroscopeCampaign campaign;
  EXPECT_THAT(canonical_definition(campaign), Not(HasSubstr("test_spin_rate_rad_s")));
  EXPECT_THAT(canonical_definition(campaign), Not(HasSubstr("sensor_1_factor")));
  EXPECT_THAT(canonical_definition(campaign), Not(HasSubstr("sensor_1_radial")));
  campaign.scenario.budget.test_spin_rate_rad_s = -2e-3;
  NoiseConfig& noise = campaign.scenario.noise;
  noise.linear_factor = {2.0, 3.0};
  noise.wire = {1e-4, 300.0, {0.3, 0.4}, {0.5, 0.6}};
  campaign.scenario.sensor.position_m = {0.1, 0.2, 0.3};
  campaign.scenario.sensor.radial_stiffness_s2 = {-0.1, -0.2};
  const std::string definition = canonical_definition(campaign);
  EXPECT_EQ(canonical_definition(test::parse_campaign("", definition)), definition);
  for_each_field(campaign.scenario, [&](const FieldInfo& field, const auto&) {
    const std::string path(field.path);
    EXPECT_THAT(definition, HasSubstr("[" + path.substr(0, path.rfind('.')) + "]\n"));
    EXPECT_THAT(definition, HasSubstr("\n" + path.substr(path.rfind('.') + 1) + " = "));
  });
}

// A preset of a text applies before its other keys.
TEST(CanonicalDefinition, StatesANominalValueThatThePresetReplaces) {
  MicroscopeCampaign campaign;
  campaign.scenario.noise = noise_preset(NoisePreset::wire_suep);
  campaign.scenario.noise.wire.damping_n_m = 0.0;
  const MicroscopeCampaign read = test::parse_campaign("", canonical_definition(campaign));
  EXPECT_EQ(read.scenario.noise.wire.damping_n_m, 0.0);
  EXPECT_EQ(read.scenario.noise.wire.mass_kg, campaign.scenario.noise.wire.mass_kg);
}

TEST(CommentedCampaign, ReadsBackToTheSameCampaign) {
  for (const MicroscopeCampaign& campaign : {MicroscopeCampaign{}, hardy2013_campaign()}) {
    const test::ScratchDirectory folder;
    test::write_text(folder / "c.toml", commented_campaign(campaign));
    expect_same(read_microscope(folder / "c.toml"), campaign);
  }
  const MicroscopeCampaign unusual = unusual_campaign();
  expect_same(test::parse_campaign("stored definition", commented_campaign(unusual),
                                   unusual.environment_table, unusual.table_columns),
              unusual);
}

TEST(CommentedCampaign, LeavesThePresetInCharge) {
  const test::ScratchDirectory folder;
  test::write_text(folder / "c.toml", commented_campaign(MicroscopeCampaign{}));
  const MicroscopeCampaign campaign =
      read_microscope(folder / "c.toml", {.assignments = {"noise.preset=flight_suref"}});
  EXPECT_EQ(campaign.scenario.noise.linear_x.white_asd, 4.49e-12);
}

std::vector<std::string> differences_after(const std::function<void(MicroscopeCampaign&)>& change) {
  MicroscopeCampaign wanted = unusual_campaign();
  change(wanted);
  return definition_differences(unusual_campaign(), wanted);
}

TEST(DefinitionDifferences, NameFieldAndBothValues) {
  EXPECT_THAT(differences_after([](MicroscopeCampaign& c) {
                c.seed = 2;
                c.name = "other";
              }),
              ElementsAre("name: \"un-usual.2\" in the database, \"other\" asked for",
                          "seed: 9223372036854775807 in the database, 2 asked for"));
  EXPECT_THAT(differences_after([](MicroscopeCampaign& c) { c.scenario.noise.scale = 0.0; }),
              ElementsAre("noise.scale: 1 in the database, 0 asked for"));
  EXPECT_THAT(
      differences_after([](MicroscopeCampaign& c) { c.scenario.sessions[3].num_orbits = 2; }),
      ElementsAre("session.a_c12.orbits: 40 in the database, 2 asked for"));
  EXPECT_THAT(
      differences_after([](MicroscopeCampaign& c) { c.scenario.sessions.resize(2); }),
      ElementsAre("session: 11 (k2_sensor_2 a_c11_delta_z a_c11_delta_y a_c12 a_c13 a_d11_prime "
                  "a_d12 a_d13 k2d k2_sensor_1 a_c11_delta_x) in the database, 2 (k2_sensor_2 "
                  "a_c11_delta_z) asked for"));
  EXPECT_THAT(
      differences_after(
          [](MicroscopeCampaign& c) { c.scenario.sessions[8].excitations[0].amplitude = 1e-8; }),
      ElementsAre(
          "session.k2d.excitations: [{ kind = \"drag_free\", axis = \"x\", amplitude_m_s2 = "
          "2e-8, frequency_hz = 0.00122847554 }] in the database, [{ kind = \"drag_free\", "
          "axis = \"x\", amplitude_m_s2 = 1e-8, frequency_hz = 0.00122847554 }] asked for"));
  EXPECT_THAT(
      differences_after([](MicroscopeCampaign& c) { c.dispersions[7].value = 0.5; }),
      ElementsAre(
          "dispersion.misalignment_rad.sensor_1_y: { law = \"fixed\", value = -0.0 } in the "
          "database, { law = \"fixed\", value = 0.5 } asked for"));
}

// A campaign without tests has the fields of tests by default.
TEST(DefinitionDifferences, NameWhatATestBrings) {
  const std::vector<std::string> lines = differences_after([](MicroscopeCampaign& c) {
    c.scenario.sessions.emplace_back().target = SessionTarget::ep_test;
    c.scenario.gaps.glitch_rate_hz = 0.02;
    c.scenario.drag_free.resonator_damping = 0.5;
  });
  EXPECT_THAT(lines, Contains("gaps.glitch_rate_hz: 0 in the database, 0.02 asked for"));
  EXPECT_THAT(lines, Contains("drag_free.resonator_damping: 0 in the database, 0.5 asked for"));
}

TEST(DefinitionDifferences, IncludeTheValuesOfDataFiles) {
  EXPECT_THAT(differences_after([](MicroscopeCampaign& c) { c.table_columns[0][1] = 2.5; }),
              ElementsAre("dispersion.star_tracker_bias_rad.head_2_z of run 1: 2 in the database, "
                          "2.5 asked for"));
  EXPECT_THAT(
      differences_after([](MicroscopeCampaign& c) { c.environment_table[1].linear_m_s2[2] = 0.0; }),
      ElementsAre("environment.file: other values in row 2 in the database, those of air "
                  "\"thin\".csv asked for"));
  EXPECT_THAT(differences_after([](MicroscopeCampaign& c) { c.environment_table.pop_back(); }),
              ElementsAre("environment.file: 2 rows in the database, 1 rows asked for"));
}

TEST(DefinitionDifferences, LetACampaignGrowAndItsFilesMove) {
  EXPECT_THAT(differences_after([](MicroscopeCampaign& c) {
                c.num_runs = 4;
                c.table_columns[0] = {1.0, 2.0, 3.0, 40.0, 50.0};
                c.environment_file = "elsewhere/air.csv";
                c.dispersions[59].file = "elsewhere/heads.csv";
              }),
              IsEmpty());
}

}  // namespace
}  // namespace proofmass::coordinator
