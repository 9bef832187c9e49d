#include "core/microscope/definition/campaign_definition.hpp"

#include <fmt/format.h>

#include <type_traits>

#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "tests/support/parse_campaign.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

/// The bits of every number of a campaign, whatever its meaning, in one order.
std::vector<std::uint64_t> bits_of(const MicroscopeCampaign& campaign) {
  std::vector<std::uint64_t> bits{campaign.seed, campaign.num_runs};
  const auto add = [&](const auto&... values) {
    (bits.push_back(std::bit_cast<std::uint64_t>(static_cast<double>(values))), ...);
  };
  for_each_field(campaign.scenario, [&](const FieldInfo&, const auto& value) { add(value); });
  for (const Session& session : campaign.scenario.sessions) {
    add(static_cast<int>(session.target), session.num_orbits, session.spin_rate_rad_s,
        static_cast<int>(session.drag_free), session.excitations.size());
    for (const Excitation& excitation : session.excitations) {
      add(static_cast<int>(excitation.kind), static_cast<int>(excitation.axis),
          static_cast<int>(excitation.motion), excitation.amplitude, excitation.frequency_hz);
    }
    for (const auto* const lines : {&session.fit_lines, &session.known_lines}) {
      add(lines->size());
      for (const LineMultiple& line : *lines) {
        add(line.orbital, line.excitation, line.spin);
        for (const double multiple : line.further) add(multiple);
      }
    }
  }
  for (const Dispersion& law : campaign.dispersions) {
    add(static_cast<int>(law.law), law.minimum, law.maximum, law.mean, law.standard_deviation,
        law.value);
  }
  for (const EnvironmentRow& row : campaign.environment_table) {
    add(row.time_s);
    for (const double value : row.linear_m_s2) add(value);
    for (const double value : row.angular_rad_s2) add(value);
  }
  for (const auto& column : campaign.table_columns) {
    for (const double value : column) add(value);
  }
  return bits;
}

/// Makes campaigns of which every number has all its digits.
class RandomCampaigns {
 public:
  explicit RandomCampaigns(std::uint64_t seed) : random_(seed) {}

  MicroscopeCampaign next() {
    MicroscopeCampaign campaign;
    campaign.name = "random." + std::to_string(random_() % 1000);
    campaign.seed = random_() >> 1;
    campaign.num_runs = 1 + random_() % 5;
    add_environment(campaign);
    if (random_() % 2 == 0) add_test(campaign);
    for (std::size_t i = 0; i < num_drawn; ++i) change_law(campaign, i);
    change_fields(campaign);
    for (Session& session : campaign.scenario.sessions) change_session(campaign, session);
    campaign.validate();
    return campaign;
  }

  std::size_t num_changed = 0;  ///< Numbers that another one could replace.

 private:
  double fraction() { return static_cast<double>(random_() >> 11) * 0x1.0p-53; }

  /// Any number at all, or one near to the number that was there.
  double other(double value) {
    if (random_() % 4 == 0) return std::bit_cast<double>(random_());
    if (random_() % 8 == 0) return -0.0;
    return value * (1.0 + 0.01 * (fraction() - 0.5)) + (value == 0.0 ? 1e-12 * fraction() : 0.0);
  }

  /// Keeps the change if the campaign is still a valid one.
  template <typename Value>
  void try_change(const MicroscopeCampaign& campaign, Value& field, Value value) {
    const Value former = std::exchange(field, value);
    try {
      campaign.validate();
      ++num_changed;
    } catch (const ConfigError&) {
      field = former;
    }
  }

  void change_fields(MicroscopeCampaign& campaign) {
    for_each_field(campaign.scenario, [&](const FieldInfo& info, auto& value) {
      using Value = std::decay_t<decltype(value)>;
      if constexpr (std::is_same_v<Value, double>) {
        try_change(campaign, value, other(value));
      } else if constexpr (std::is_integral_v<Value>) {
        try_change(campaign, value, value + 1);
      } else if (info.path != "environment.kind") {
        try_change(campaign, value, static_cast<Value>(1 + random_() % 3));
      }
    });
  }

  void change_session(const MicroscopeCampaign& campaign, Session& session) {
    try_change(campaign, session.name, session.name + "_" + std::to_string(random_() % 9));
    try_change(campaign, session.num_orbits, session.num_orbits + 1);
    try_change(campaign, session.spin_rate_rad_s, other(0.003));
    for (Excitation& excitation : session.excitations) {
      try_change(campaign, excitation.amplitude, other(excitation.amplitude));
      try_change(campaign, excitation.frequency_hz, other(excitation.frequency_hz));
    }
    std::vector<Excitation> excitations = session.excitations;
    excitations.push_back(
        {ExcitationKind::attitude, Axis::z, 1e-3 * fraction(), 7e-4 * fraction()});
    if (random_() % 2 == 0) try_change(campaign, session.excitations, excitations);
    std::vector<LineMultiple> lines = session.known_lines;
    lines.push_back({3.0 + fraction(), session.excitations.empty() ? 0.0 : fraction(),
                     session.spin_rate_rad_s == 0.0 ? 0.0 : fraction()});
    if (session.excitations.size() > 1) lines.back().further[0] = fraction();
    try_change(campaign, session.known_lines, lines);
  }

  void change_law(MicroscopeCampaign& campaign, std::size_t i) {
    const double width = draw_groups()[0].bound * (0.5 + fraction());
    Dispersion law;
    law.law = static_cast<Law>(1 + random_() % 5);
    if (law.law == Law::uniform || law.law == Law::truncated_normal) {
      law.minimum = -width;
      law.maximum = width * fraction() + 1e-9;
    }
    if (law.law == Law::normal || law.law == Law::truncated_normal) {
      law.mean = -width * fraction();
      law.standard_deviation = width * fraction() + 1e-12;
    }
    if (law.law == Law::fixed)
      law.value = std::ldexp(fraction(), -static_cast<int>(random_() % 60));
    if (law.law == Law::table) {
      law.file = "d\"a\\t\u00e9\t" + std::to_string(i);
      law.column = "c'" + std::to_string(i);
      auto& column = campaign.table_columns.emplace_back();
      for (std::uint64_t run = 0; run < campaign.num_runs; ++run) column.push_back(other(1e-3));
      for (double& value : column) value = std::isfinite(value) ? value : fraction();
    }
    campaign.dispersions[i] = law;
  }

  static void add_test(MicroscopeCampaign& campaign) {
    Session session;
    session.name = "test";
    session.target = SessionTarget::ep_test;
    campaign.scenario.sessions.push_back(session);
  }

  void add_environment(MicroscopeCampaign& campaign) {
    if (random_() % 2 == 0) return;
    campaign.scenario.environment.kind = EnvironmentKind::file;
    campaign.environment_file = "air \"thin\".csv";
    for (int i = 0; i < 10; ++i) {
      campaign.environment_table.push_back({.time_s = 1000.0 * i + fraction() * (i == 0 ? 0 : 1),
                                            .linear_m_s2 = {1e-8 * fraction(), -0.0, fraction()},
                                            .angular_rad_s2 = {fraction(), 1e-300, -fraction()}});
    }
  }

  std::mt19937_64 random_;
};

TEST(CampaignOf, IsTheCampaignToTheLastBit) {
  RandomCampaigns campaigns(/*seed=*/12);
  for (int i = 0; i < 100; ++i) {
    SCOPED_TRACE(i);
    const MicroscopeCampaign campaign = campaigns.next();
    const Definition definition = definition_of(campaign);
    const MicroscopeCampaign read = campaign_of(definition);
    EXPECT_EQ(read.name, campaign.name);
    EXPECT_EQ(bits_of(read), bits_of(campaign));
    EXPECT_EQ(read.environment_file, campaign.environment_file);
    EXPECT_EQ(read.dispersions, campaign.dispersions);
    EXPECT_EQ(read.scenario.sessions, campaign.scenario.sessions);
    EXPECT_EQ(definition_of(read), definition);
    EXPECT_EQ(definition.text, canonical_definition(campaign));
  }
  EXPECT_GT(campaigns.num_changed, 100U * 80U) << "or there was little to be tested";
}

// Definitions of the model hardy2013-3 and before had limits that no run is held to any more.
// Programs that know no test stored such campaigns, and workers compare texts to the byte.
TEST(CanonicalDefinition, OfACampaignThatDoesNotTestHasNothingOfTests) {
  MicroscopeCampaign campaign;
  const std::string without = canonical_definition(campaign);
  EXPECT_THAT(without, Not(HasSubstr("eotvos_parameter")));
  EXPECT_THAT(without, Not(HasSubstr("test_a_c11")));
  EXPECT_THAT(commented_campaign(campaign), Not(HasSubstr("[gaps]")));
  EXPECT_THAT(commented_campaign(campaign), Not(HasSubstr("eotvos_parameter")));
  campaign.scenario.sessions.front().target = SessionTarget::ep_test;
  EXPECT_THAT(canonical_definition(campaign), HasSubstr("eotvos_parameter = 1e-15\n"));
  campaign.dispersions[index_of_eotvos_parameter].value = 1e-14;
  EXPECT_THAT(canonical_definition(campaign),
              HasSubstr("[dispersion.eotvos_parameter]\n"
                        "masses_2_1 = { law = \"fixed\", value = 1e-14 }\n"));
}

TEST(ParseCampaign, RefusesWhatIsOfATestWithoutOne) {
  for (const std::string table :
       {"[objective]\neotvos_parameter = 1e-15\n", "[gaps]\nglitch_rate_hz = 0.01\n",
        "[drag_free]\nresonator_damping = 0.5\n"}) {
    const std::string text = "[campaign]\nname = \"c\"\n" + table;
    EXPECT_THAT(
        test::message_of<DefinitionError>([&] { (void)test::parse_campaign("c.toml", text); }),
        HasSubstr("(only where a session tests the equivalence principle: none has the "
                  "target ep_test)"));
  }
}

// Campaigns with tests were stored before any could lose data.
TEST(CanonicalDefinition, HasGapsWhereTestsLoseData) {
  MicroscopeCampaign campaign;
  Session& test = campaign.scenario.sessions.emplace_back();
  test.name = "test";
  test.target = SessionTarget::ep_test;
  const MicroscopeCampaign without = campaign;
  EXPECT_THAT(canonical_definition(campaign), Not(HasSubstr("[gaps]")));
  EXPECT_THAT(canonical_definition(campaign), Not(HasSubstr("resonator")));
  campaign.scenario.gaps.glitch_rate_hz = 0.01;
  campaign.scenario.gaps.test = {.depth = 0.5, .phase_rad = 0.0};
  const std::string text = canonical_definition(campaign);
  EXPECT_THAT(text, HasSubstr("\n[gaps]\nglitch_rate_hz = 0.01\ntest_modulation = 0.5\n["));
  EXPECT_EQ(canonical_definition(test::parse_campaign("c.toml", text)), text);
  const auto differences = without.differences_from(campaign);
  ASSERT_EQ(differences.size(), 2u);
  EXPECT_EQ(differences[0].field, "gaps.glitch_rate_hz");
  EXPECT_EQ(differences[1].field, "gaps.test_modulation");
  campaign.scenario.gaps.spin.depth = 0.6;
  EXPECT_THROW((void)test::parse_campaign("c.toml", canonical_definition(campaign)),
               DefinitionError);
}

// The objectives of a test are those of one campaign alone: its sessions are the difference.
TEST(CompareDefinitions, OfWhichOneTestsNamesTheSessions) {
  MicroscopeCampaign second;
  second.scenario.sessions.push_back(second.scenario.sessions.front());
  second.scenario.sessions.back().target = SessionTarget::ep_test;
  const auto differences = MicroscopeCampaign{}.differences_from(second);
  ASSERT_EQ(differences.size(), 1u);
  EXPECT_EQ(differences[0].field, "session");
}

TEST(CampaignOf, ReadsDefinitionsWithTheFormerLimitsOfHealth) {
  const MicroscopeCampaign campaign = hardy2013_campaign();
  Definition definition = campaign.definition(TableColumns::included);
  const std::string limits =
      "[health]\nattitude_max_rad = 0.0014\nresidual_max_m_s2 = 1e-10\nquadratic_noise_max = 1\n"
      "square_noise_max = 0.0005\n";
  const std::size_t place = definition.text.find("[estimation]\n");
  ASSERT_NE(place, std::string::npos);
  definition.text.insert(place, limits);
  EXPECT_EQ(bits_of(campaign_of(definition)), bits_of(campaign));
  definition.text.insert(place + limits.size(), "more = 1\n");
  EXPECT_THROW((void)campaign_of(definition), DefinitionError);
  EXPECT_THROW((void)test::parse_campaign("a.toml", "[campaign]\nname = \"a\"\n" + limits),
               DefinitionError);
}

TEST(CampaignOf, MayLackTheColumns) {
  RandomCampaigns campaigns(/*seed=*/13);
  for (int i = 0; i < 10; ++i) {
    MicroscopeCampaign campaign = campaigns.next();
    const Definition definition = definition_of(campaign, TableColumns::left_out);
    campaign.table_columns.clear();
    EXPECT_EQ(bits_of(campaign_of(definition, TableColumns::left_out)), bits_of(campaign));
  }
}

std::string with_laws(const std::string& of_y) {
  return "[campaign]\nname = \"a\"\n[dispersion.offcentring_m.x]\nlaw = \"normal\"\nmean = 0\n"
         "standard_deviation = 2e-6\n[dispersion.offcentring_m.y]\nlaw = \"correlated\"\nmean = 0\n"
         "standard_deviation = 4e-6\nwith = [\"offcentring_m.x\"]\n" +
         of_y;
}

TEST(ParseCampaign, TakesCovariancesInPlaceOfCorrelations) {
  const MicroscopeCampaign campaign =
      test::parse_campaign("a.toml", with_laws("covariances = [4e-12]\n"));
  EXPECT_NEAR(campaign.dispersions[25].correlations.at(0), 0.5, 1e-15);
  const auto refusal_of = [](const std::string& of_y) {
    return test::message_of<Error>([&] { (void)test::parse_campaign("a.toml", with_laws(of_y)); });
  };
  EXPECT_THAT(refusal_of("covariances = [4e-12]\ncorrelations = [0.5]\n"),
              HasSubstr("stands in place of correlations: leave out one of them"));
  EXPECT_THAT(
      refusal_of("covariances = [9e-12]\n"),
      ::testing::StartsWith("a.toml:12: dispersion.offcentring_m.y.covariances as correlations = "
                            "[1.125] (with those before it, the correlations must be positive"));
  EXPECT_THAT(refusal_of("covariances = [1e-12, 0]\n"),
              HasSubstr(".covariances as correlations = 2 of them (must be 1"));
  EXPECT_THAT(refusal_of("covariances = [\"x\"]\n"), HasSubstr("numbers"));
  EXPECT_THAT(refusal_of(""), HasSubstr("law correlated needs it"));
}

TEST(CampaignOf, HasLinesWithoutNegativeZeros) {
  const MicroscopeCampaign nominal;
  std::string text = canonical_definition(nominal);
  const std::string from = "fit_lines = [[2, 0]]";
  ASSERT_NE(text.find(from), std::string::npos);
  text.replace(text.find(from), from.size(), "fit_lines = [[2, -0.0, -0.0]]");
  EXPECT_EQ(canonical_definition(test::parse_campaign("text", text)),
            canonical_definition(nominal));
}

// The longest names, of the characters that take most to write.
TEST(DefinitionOf, AnyValidCampaignIsNotTooLarge) {
  MicroscopeCampaign campaign;
  const std::string name(data_name_size_max, '\x01');
  for (Dispersion& law : campaign.dispersions) {
    law = {.law = Law::table, .file = name, .column = name};
  }
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = name;
  campaign.environment_table = {{0.0, {}, {}}, {6000.0, {}, {}}};
  campaign.table_columns.resize(num_drawn, std::vector<double>(campaign.num_runs));
  EXPECT_NO_THROW(campaign.validate());
  // At most 64 sessions are read, with 16 lines of six numbers and four excitations each.
  constexpr std::size_t sessions_size_max = 64 * (16 * (6 * 26 + 8) + 4 * 200 + 300);
  EXPECT_LT(canonical_definition(campaign).size() + sessions_size_max, definition_text_size_max);
  campaign.dispersions[0].file += "x";
  EXPECT_THROW(campaign.validate(), ConfigError);
}

using detail::quoted_text;

TEST(QuotedText, EscapesWhatTomlDoesNotTakePlain) {
  EXPECT_EQ(quoted_text("a\"b\\c"), R"("a\"b\\c")");
  EXPECT_EQ(quoted_text("a\nb"), R"("a\u000Ab")");
  EXPECT_EQ(quoted_text("Δx"), "\"Δx\"");
}

}  // namespace
}  // namespace proofmass
