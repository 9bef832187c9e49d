#include "core/microscope/campaign/microscope_campaign.hpp"

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/model.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

std::string refusal_after(const std::function<void(MicroscopeCampaign&)>& change) {
  MicroscopeCampaign campaign;
  change(campaign);
  return test::message_of<ConfigError>([&] { campaign.validate(); });
}

// The law of offcentring_m.y becomes a table of these values.
void use_table(MicroscopeCampaign& campaign, std::vector<double> column) {
  campaign.num_runs = 3;
  campaign.dispersions[25] = Dispersion{};
  campaign.dispersions[25].law = Law::table;
  campaign.dispersions[25].file = "draws.csv";
  campaign.dispersions[25].column = "dy";
  campaign.table_columns = {std::move(column)};
}

void use_environment(MicroscopeCampaign& campaign, EnvironmentTable table) {
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "env.csv";
  campaign.environment_table = std::move(table);
}

TEST(MicroscopeCampaign, IsInterpretedByWhatDiffersFromRunToRun) {
  MicroscopeCampaign campaign;
  EXPECT_EQ(campaign.interpretation(), Interpretation::mixed);
  for (std::size_t i = 1; i < num_drawn; ++i) campaign.dispersions[i].law = Law::fixed;
  EXPECT_EQ(campaign.interpretation(), Interpretation::mixed);
  campaign.dispersions[0].law = Law::fixed;
  EXPECT_EQ(campaign.interpretation(), Interpretation::temporal);
  campaign.scenario.noise.scale = 0.0;
  EXPECT_EQ(campaign.interpretation(), Interpretation::ensemble);
}

// Databases of former versions have χ² of all data alone, and go on being read.
TEST(MicroscopeCampaign, HasAFitOfEachSessionSinceTheSixthVersion) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  EXPECT_EQ(campaign.results().fit.size(), 2U);
  campaign.scenario.estimation.method = EstimationMethod{2};  // joint
  campaign.scenario.sessions[3].name = "A_C12";
  campaign.scenario.sessions[4].name = "a_c12";
  const std::string definition = canonical_definition(campaign);
  const ResultSchema schema = model().results_of(definition, model_version);
  ASSERT_EQ(schema.fit_parts.size(), campaign.scenario.sessions.size());
  EXPECT_EQ(schema.fit_parts[3], "A_C12");
  ASSERT_EQ(schema.fit.size(), 2 + 2 * schema.fit_parts.size());
  EXPECT_EQ(schema.fit[8].name, "chi_squared_A_C12");
  EXPECT_EQ(schema.fit[10].name, "chi_squared_a_c12_");  // Names of columns have no case.
  EXPECT_EQ(schema.fit[11].name, "degrees_of_freedom_a_c12_");
  for (const char* const version : {"hardy2013-5", "hardy2013-", "hardy2013-12x", "other-7", ""}) {
    EXPECT_EQ(model().results_of(definition, version).fit.size(), 2U) << version;
  }
  EXPECT_EQ(model().results_of(definition, "hardy2013-12").fit.size(), schema.fit.size());
  EXPECT_EQ(model().results_of("[[session", model_version).fit.size(), 2U);
}

// And those with tests have the residual of calibration sessions alone.
TEST(MicroscopeCampaign, HasAResidualOfTestsSinceTheTenthVersion) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.scenario.sessions.emplace_back().target = SessionTarget::ep_test;
  campaign.scenario.sessions.back().name = "test";
  const std::string definition = canonical_definition(campaign);
  const ResultSchema now = model().results_of(definition, model_version);
  const ResultSchema before = model().results_of(definition, "hardy2013-9");
  EXPECT_EQ(now.health.at(now.budget_level).name, "test_residual");
  EXPECT_EQ(before.health.at(before.budget_level).name, "residual");
  EXPECT_EQ(before.health.size() + 1, now.health.size());
  EXPECT_EQ(campaign.error_budget()->level, now.budget_level);
}

TEST(MicroscopeCampaign, RefusesABadName) {
  const std::string rule = " (must be 1 to 64 of [A-Za-z0-9._-], a letter or digit first)";
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.name = ""; }),
            "campaign.name = \"\"" + rule);
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.name = "a/b"; }),
            "campaign.name = \"a/b\"" + rule);
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.name = std::string(65, 'a'); }),
            "campaign.name = \"" + std::string(65, 'a') + "\"" + rule);
}

// As it is in files of before; a new campaign may not have it.
TEST(MicroscopeCampaign, MayHaveANameWithAnotherCharacterFirst) {
  for (const std::string name : {"_a", "-rf", ".."}) {
    EXPECT_EQ(refusal_after([&](MicroscopeCampaign& c) { c.name = name; }), "");
    EXPECT_NO_THROW(check_campaign_name(name, NameOrigin::stored));
    EXPECT_THROW(check_campaign_name(name, NameOrigin::given), ConfigError);
  }
}

TEST(MicroscopeCampaign, RefusesASeedThatNoFileCanHold) {
  EXPECT_EQ(refusal_after([](MicroscopeCampaign&) {}), "");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.seed = 9223372036854775807u; }), "");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.seed = 9223372036854775808u; }),
            "campaign.seed = 9223372036854775808 (must be in [0, 9223372036854775807])");
}

TEST(MicroscopeCampaign, WantsAnEnvironmentFileIfAndOnlyIfTheKindIsFile) {
  EXPECT_EQ(refusal_after(
                [](MicroscopeCampaign& c) { c.scenario.environment.kind = EnvironmentKind::file; }),
            "environment.file = \"\" (environment.kind = \"file\" needs one)");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.environment_file = "env.csv"; }),
            "environment.file = \"env.csv\" (only with environment.kind = \"file\")");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { c.environment_table.emplace_back(); }),
            "environment.file = \"\" (only with environment.kind = \"file\")");
  const EnvironmentRow start{0.0, {}, {}}, end{5950.0, {}, {}};
  EXPECT_EQ(refusal_after([&](MicroscopeCampaign& c) { use_environment(c, {start, end}); }), "");
}

TEST(MicroscopeCampaign, WantsAValueOfEachTableForEachRun) {
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) { use_table(c, {1.0, 2.0, 3.0, 4.0}); }), "");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) {
              use_table(c, {1.0, 2.0});
            }),
            "dispersion.offcentring_m.y.column = \"dy\" (has values for 2 runs, 3 are needed)");
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal_after([=](MicroscopeCampaign& c) {
              use_table(c, {1.0, infinity, 3.0});
            }),
            "dispersion.offcentring_m.y.column = \"dy\" (row 2 must be finite)");
  EXPECT_EQ(refusal_after([](MicroscopeCampaign& c) {
              use_table(c, {1.0, 2.0, 3.0});
              c.table_columns.clear();
            }),
            "dispersion = 0 columns (laws of kind table are 1)");
}

TEST(MicroscopeCampaign, YieldsTheTableValuesOfARun) {
  MicroscopeCampaign campaign;
  EXPECT_THAT(campaign.table_values(RunIndex{7}), IsEmpty());
  use_table(campaign, {1.0, 2.0, 3.0});
  EXPECT_THAT(campaign.table_values(RunIndex{2}), ElementsAre(3.0));
}

TEST(CampaignDeathTest, HasNoTableValuesBeyondItsTable) {
  MicroscopeCampaign campaign;
  use_table(campaign, {1.0, 2.0, 3.0});
  EXPECT_DEATH((void)campaign.table_values(RunIndex{3}), "internal invariant broken");
}

// With x = 13.9 the bound ν + 2√(νx) + 2x of 27 degrees of freedom is 93.5, and 3.5 % more is left
// to the densities.
TEST(MicroscopeCampaign, WarnsOfAFitThatChanceDoesNotExplain) {
  MicroscopeCampaign campaign;
  campaign.scenario.estimation.method = EstimationMethod{2};
  RunResult result;
  result.status = RunStatus::completed;
  result.truth.assign(num_parameters, 0.0);
  result.standard_error.assign(num_parameters, 0.0);
  result.health.assign(health_values().size(), 0.0);
  result.standard_error[index(Parameter::a_c12)] = 3e-5;
  result.standard_error[index(Parameter::k2d)] = 20.0;
  result.fit = {96.0, 27.0};
  EXPECT_THAT(campaign.warner()(result), IsEmpty());
  result.fit = {108.0, 27.0};
  const std::vector<Warning> warnings = campaign.warner()(result);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].effect, "fit");
  EXPECT_EQ(warnings[0].quantity, index(Parameter::k2d));
  EXPECT_DOUBLE_EQ(warnings[0].part, 2.0 * 20.0 / 250.0);
}

// Seven times 146 s, the time constant of the attitude loop's integral.
TEST(MicroscopeCampaign, NotesThatItsLoopsHaveNotSettled) {
  MicroscopeCampaign campaign;
  campaign.scenario.simulation.settling_s = 1030.0;
  EXPECT_EQ(campaign.note(), "");
  campaign.scenario.simulation.settling_s = 0.0;
  EXPECT_THAT(campaign.note(),
              ::testing::HasSubstr("simulation.settling_s = 0 is less than the 1"));
}

/// The shifts that a campaign with a test warns of, for K2d at its bound.
std::vector<Warning> warnings_of_residuals(double residual_m_s2, double test_residual_m_s2) {
  MicroscopeCampaign campaign;
  campaign.scenario.sessions.emplace_back().target = SessionTarget::ep_test;
  RunResult result;
  result.truth.assign(num_parameters + num_test_parameters, 0.0);
  result.truth[index(Parameter::k2d)] = 14000.0;
  result.health.assign(num_health_values + 1, 0.0);
  for (std::size_t i = 0; i < num_health_values; ++i) {
    if (health_values()[i].member == &LoopHealth::residual_m_s2) result.health[i] = residual_m_s2;
  }
  result.health.back() = test_residual_m_s2;
  std::vector<Warning> warnings = campaign.warner()(result);
  std::erase_if(warnings, [](const Warning& of) { return of.quantity < num_parameters; });
  return warnings;
}

// A line of 2R beside the push of the session of a_d11', which lasts 9.83 orbits, makes sidebands
// that leak 2·K2d·2R/(9.83 π) into it, and 2/g of that times the residual of the test into δ: with
// R = 3e-10 and 1e-8 m/s² 1.4e-15, a part of 1.4 of 1e-15.
TEST(MicroscopeCampaign, WarnsOfAResidualThatTheCalibrationDoesNotTakeFromATest) {
  EXPECT_THAT(warnings_of_residuals(1e-12, 1e-8), IsEmpty());
  EXPECT_THAT(warnings_of_residuals(3e-10, 3e-10), IsEmpty());
  const std::vector<Warning> warnings = warnings_of_residuals(3e-10, 1e-8);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].effect, "residual");
  EXPECT_EQ(warnings[0].quantity, num_parameters);
  const double moved = 2.0 * 14000.0 * 6e-10 / (9.832 * std::numbers::pi);
  EXPECT_NEAR(warnings[0].part, 2.0 / 7.9 * 1e-8 * moved / 1e-15, 0.01 * warnings[0].part);
}

// Without any session that is free of excitations nothing measures the noise of the loops.
TEST(MicroscopeCampaign, NotesThatNoSessionWatchesTheNoise) {
  MicroscopeCampaign campaign;
  EXPECT_EQ(campaign.note(), "");
  std::erase_if(campaign.scenario.sessions,
                [](const Session& session) { return session.excitations.empty(); });
  EXPECT_EQ(campaign.note(),
            "no session watches the noise of the loops, which may move every estimate: add one "
            "with target = \"no_target\" and fit_lines = [[2, 0]]");
}

// 1 − e⁻⁰·³ of the samples; in a modulation of λd = 1.2, 1 − e⁻¹·² I₀(1.2) = 58 %.
TEST(MicroscopeCampaign, NotesHowMuchTestsLose) {
  MicroscopeCampaign campaign;
  campaign.scenario.sessions.emplace_back().target = SessionTarget::ep_test;
  campaign.scenario.gaps.glitch_rate_hz = 0.02;
  campaign.scenario.gaps.glitch_duration_s = 15.0;
  EXPECT_EQ(campaign.note(), "[gaps] takes about 26 % of the samples of tests");
  campaign.scenario.gaps = {.glitch_rate_hz = 0.06, .glitch_duration_s = 20.0};
  campaign.scenario.gaps.test.depth = 1.0;
  EXPECT_EQ(campaign.note(), "[gaps] takes about 58 % of the samples of tests");
}

// What comes from space turns with the frame: in half a turn it changes its sign.
TEST(MicroscopeCampaign, NotesAnEnvironmentFileThatCannotBeRight) {
  using ::testing::HasSubstr;
  MicroscopeCampaign campaign;
  const double period_s = campaign.scenario.orbit.period_s;
  const double whole_turn_rad_s = 2.0 * std::numbers::pi / period_s;
  campaign.environment_table = {{.time_s = 0.0}, {.time_s = period_s}};
  EXPECT_EQ(campaign.note(), "");
  for (Session& session : campaign.scenario.sessions) {
    session.spin_rate_rad_s = 4.5 * whole_turn_rad_s;
  }
  EXPECT_THAT(campaign.note(), HasSubstr("the satellite makes 4.5 turns: not a whole number"));
  campaign.environment_table.back().time_s = 40.0 * period_s;
  EXPECT_EQ(campaign.note(), "");
  campaign.scenario.sessions[3].spin_rate_rad_s = 0.0;
  EXPECT_THAT(campaign.note(), HasSubstr("spins otherwise in a_c12 than in k2_sensor_2"));
}

}  // namespace
}  // namespace proofmass
