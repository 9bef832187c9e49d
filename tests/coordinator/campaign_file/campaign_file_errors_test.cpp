#include <gtest/gtest.h>
#include <sys/stat.h>

#include <string>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/campaign_file/scratch_folder.hpp"

namespace proofmass::coordinator {
namespace {

using test::refusal_of;

TEST(CampaignFileErrors, NameAnUnknownKeyAndTheNearestOne) {
  EXPECT_EQ(refusal_of("[noise]\n\nscal = 0\n"),
            "campaign.toml:3: noise.scal = 0 (unknown key; nearest is noise.scale)");
  EXPECT_EQ(refusal_of("[nois]\nscale = 0\n"),
            "campaign.toml:2: nois.scale = 0 (unknown key; nearest is noise.scale)");
  EXPECT_EQ(refusal_of("[[sesion]]\nname = \"a\"\n"),
            "campaign.toml:1: sesion = [...] (unknown key; nearest is session)");
  EXPECT_EQ(refusal_of("color = \"red\"\n"), "campaign.toml:1: color = \"red\" (unknown key)");
  EXPECT_EQ(refusal_of("[empty]\n"), "campaign.toml:1: empty = a table (unknown key)");
  EXPECT_EQ(refusal_of("\"noise.scale\" = 0\n"),
            "campaign.toml:1: \"noise.scale\" = 0 (unknown key; nearest is noise.scale)");
  EXPECT_EQ(refusal_of("[dispersion.offcentering_m]\nmaximum = 1\n"),
            "campaign.toml:2: dispersion.offcentering_m.maximum = 1 (unknown key; nearest is "
            "dispersion.offcentring_m.maximum)");
}

TEST(CampaignFileErrors, SayThatACampaignNeedsAName) {
  for (const char* text : {"", "# a comment\n", "noise.scale = 0\n"}) {
    const test::ScratchFolder folder;
    const std::string file = folder.write("campaign.toml", text).string();
    try {
      (void)read_campaign(file);
      FAIL() << text;
    } catch (const DefinitionError& error) {
      EXPECT_EQ(error.what(), file + ": campaign.name is missing (every campaign needs one)");
    }
  }
}

TEST(CampaignFileErrors, SayThatAKeyIsSetTwice) {
  EXPECT_EQ(refusal_of("", {.assignments = {"noise.scale=0", "noise.scale=1"}}),
            "--set noise.scale=1: noise.scale is set more than once");
  EXPECT_EQ(refusal_of("", {.assignments = {"campaign.runs=5"}, .num_runs = 7}),
            "--runs 7: campaign.runs is set more than once");
}

TEST(CampaignFileErrors, NameAPipeAsDataFileAndDoNotWaitForIt) {
  const test::ScratchFolder folder;
  ASSERT_EQ(::mkfifo((folder.path() / "table.csv").c_str(), 0600), 0);  // Nobody writes to it.
  EXPECT_EQ(refusal_of("[environment]\nkind = \"file\"\nfile = \"table.csv\"\n", folder),
            "campaign.toml:3: environment.file = \"table.csv\" (is a pipe, a socket or a device)");
}

TEST(CampaignFileErrors, NameAWrongType) {
  EXPECT_EQ(refusal_of("noise.scale = \"off\""),
            "campaign.toml:1: noise.scale = \"off\" (must be a number)");
  EXPECT_EQ(refusal_of("noise.scale = true"),
            "campaign.toml:1: noise.scale = true (must be a number)");
  EXPECT_EQ(refusal_of("noise.scale = [1, 2.5, [3]]"),
            "campaign.toml:1: noise.scale = [1, 2.5, ...] (must be a number)");
  EXPECT_EQ(refusal_of("noise.scale = 2024-01-01"),
            "campaign.toml:1: noise.scale = a date or time (must be a number)");
  EXPECT_EQ(refusal_of("estimation.num_rounds_max = 3.0"),
            "campaign.toml:1: estimation.num_rounds_max = 3 (must be a whole number without point "
            "or exponent)");
  EXPECT_EQ(refusal_of("campaign.runs = \"many\""),
            "campaign.toml:1: campaign.runs = \"many\" (must be a whole number without point or "
            "exponent)");
  EXPECT_EQ(refusal_of("campaign.name = 5"), "campaign.toml:1: campaign.name = 5 (must be a text)");
  EXPECT_EQ(refusal_of("noise = 5"), "campaign.toml:1: noise = 5 (must be a table)");
  EXPECT_EQ(refusal_of("noise.preset = \"design\""),
            "campaign.toml:1: noise.preset = \"design\" (must be \"design_2013\" or "
            "\"flight_suref\")");
}

TEST(CampaignFileErrors, NameAValueOutOfRange) {
  EXPECT_EQ(refusal_of("[estimation]\ntransient_s = -5"),
            "campaign.toml:2: estimation.transient_s = -5 (must be >= 0)");
  EXPECT_EQ(refusal_of("noise.scale = nan"), "campaign.toml:1: noise.scale = nan (must be >= 0)");
  EXPECT_EQ(refusal_of("noise.scale = inf"), "campaign.toml:1: noise.scale = inf (must be >= 0)");
  EXPECT_EQ(refusal_of("environment.linear_x.mean_m_s2 = -inf"),
            "campaign.toml:1: environment.linear_x.mean_m_s2 = -inf (must be finite)");
  EXPECT_EQ(refusal_of("campaign.seed = -1"), "campaign.toml:1: campaign.seed = -1 (must be >= 0)");
  EXPECT_EQ(refusal_of("campaign.runs = 0"),
            "campaign.toml:1: campaign.runs = 0 (must be in [1, 1000000000])");
  EXPECT_EQ(refusal_of("campaign.name = \"a b\""),
            "campaign.toml:1: campaign.name = \"a b\" (must be 1 to 64 of [A-Za-z0-9._-], a letter "
            "or digit first)");
}

TEST(CampaignFileErrors, NameBrokenTomlByLine) {
  EXPECT_TRUE(refusal_of("[noise]\nscale = 1\nscale = 2\n").starts_with("campaign.toml:3: "));
  EXPECT_TRUE(refusal_of("[noise]\nscale = = 1\n").starts_with("campaign.toml:2: "));
  EXPECT_TRUE(refusal_of("campaign.seed = 18446744073709551615").starts_with("campaign.toml:1: "));
  EXPECT_TRUE(refusal_of("campaign.name = \"\xff\"").starts_with("campaign.toml:1: "));
}

TEST(CampaignFileErrors, ReportTheFirstInTheFile) {
  EXPECT_EQ(refusal_of("[orbit]\nperiod = 1\n[campaign]\nruns = 0\n"),
            "campaign.toml:2: orbit.period = 1 (unknown key; nearest is orbit.period_s)");
  EXPECT_EQ(refusal_of("[noise]\nscale = -1\n[campaign]\nruns = 0\nfoo = 1\n"),
            "campaign.toml:2: noise.scale = -1 (must be >= 0)");
}

TEST(CampaignFileErrors, NameAFileThatCannotBeRead) {
  const test::ScratchFolder folder;
  const auto refusal = [&](const std::filesystem::path& file) {
    try {
      (void)read_campaign(file);
    } catch (const DefinitionError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string absent = (folder.path() / "absent.toml").string();
  EXPECT_EQ(refusal(absent), absent + ": cannot be read: No such file or directory");
  EXPECT_EQ(refusal(folder.path()), folder.path().string() + ": is a directory");
  const auto large = folder.write("large.toml", std::string(campaign_file_size_max + 1, '\n'));
  EXPECT_EQ(refusal(large), large.string() + ": is larger than 1048576 bytes");
  for (const std::size_t size : {std::size_t{16}, campaign_file_size_max + 1}) {
    std::string content("SQLite format 3\0", 16);  // https://www.sqlite.org/fileformat.html, 1.3
    content.resize(size);
    const auto database = folder.write("t.db", content);
    EXPECT_EQ(refusal(database), "campaign file = " + database.string() +
                                     " (is a campaign database; give the TOML file)");
  }
}

// --- sessions ---

std::string with_session(const std::string& keys) { return "[[session]]\n" + keys; }

TEST(SessionErrors, NameAMissingOrUnknownKey) {
  EXPECT_EQ(refusal_of(with_session("target = \"a_c12\"")),
            "campaign.toml:1: session[0].name is missing (every one needs it)");
  EXPECT_EQ(refusal_of(with_session("name = \"a\"")),
            "campaign.toml:1: session[0].target is missing (every one needs it)");
  EXPECT_EQ(refusal_of(with_session("name = \"a\"\ntarget = \"a_c12\"\norbit = 1")),
            "campaign.toml:4: session[0].orbit = 1 (unknown key; nearest is session[0].orbits)");
  EXPECT_EQ(refusal_of("session = 3"), "campaign.toml:1: session = 3 (must be a list of tables)");
  EXPECT_EQ(refusal_of("session = [3]"),
            "campaign.toml:1: session = [3] (must be a list of tables)");
  EXPECT_EQ(refusal_of("session = []"),
            "campaign.toml:1: session = 0 sessions (none has the target a_c11_delta_x)");
}

TEST(SessionErrors, NameAWrongLine) {
  const std::string head = "name = \"a\"\ntarget = \"a_c12\"\n";
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = 2")),
            "campaign.toml:4: session[0].fit_lines = 2 (must be a list such as [[2, 0], [0, 1]])");
  const std::string rule =
      " (must be two or three numbers, the multiples of f_orb, of the excitation and of the spin)";
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = [[2, 0],\n [1]]")),
            "campaign.toml:5: session[0].fit_lines[1] = [1]" + rule);
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = [[2, 0, 1, 0]]")),
            "campaign.toml:4: session[0].fit_lines[0] = [2, 0, 1, 0]" + rule);
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = [[2, []]]")),
            "campaign.toml:4: session[0].fit_lines[0] = [2, ...]" + rule);
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = [[2, [1, \"1\"]]]")),
            "campaign.toml:4: session[0].fit_lines[0] = [2, ...]" + rule);
  EXPECT_EQ(refusal_of(with_session(head + "fit_lines = [[2, true]]")),
            "campaign.toml:4: session[0].fit_lines[0] = [2, true]" + rule);
  EXPECT_EQ(refusal_of(with_session(head + "orbits = 3000000000")),
            "campaign.toml:4: session[0].orbits = 3000000000 (must be in [-2147483648, "
            "2147483647])");
}

std::string with_excitation(const std::string& keys) {
  return with_session("name = \"a\"\ntarget = \"a_c12\"\nexcitations = [{ " + keys + " }]\n");
}

TEST(SessionErrors, NameAWrongKeyOfAnExcitation) {
  const std::string place = "campaign.toml:4: session[0].excitations[0]";
  EXPECT_EQ(refusal_of(with_excitation("axis = \"y\", frequency_hz = 1, amplitude_m = 1")),
            place + ".kind is missing (every one needs it)");
  EXPECT_EQ(refusal_of(with_excitation(
                "kind = \"drag_free\", axis = \"y\", frequency_hz = 1, amplitude_m_s2 = 1, "
                "amplitude_m = 2")),
            place + ".amplitude_m = 2 (not a key of kind drag_free, which has amplitude_m_s2)");
  EXPECT_EQ(refusal_of(with_excitation(
                "kind = \"drag_free\", axis = \"y\", frequency_hz = 1, amplitude_m_s2 = 1, "
                "moves = \"mass_1\"")),
            place + ".moves = \"mass_1\" (only with kind = \"test_mass\")");
  EXPECT_EQ(refusal_of(with_excitation(
                "kind = \"drag_free\", axis = \"w\", frequency_hz = 1, amplitude_m_s2 = 1")),
            place + ".axis = \"w\" (must be \"x\", \"y\" or \"z\")");
  EXPECT_EQ(refusal_of(with_session("name = \"a\"\ntarget = \"a_c12\"\nexcitations = 1\n")),
            "campaign.toml:4: session[0].excitations = 1 (must be a list of tables)");
}

TEST(SessionErrors, OfAllSessionsTogetherHaveAPlaceToo) {
  std::string text = commented_campaign(hardy2013_campaign());
  const std::size_t position = text.find("orbits = 40");
  text.replace(position, 11, "orbits = 0 ");
  const auto line = std::count(text.begin(), text.begin() + static_cast<long>(position), '\n') + 1;
  EXPECT_EQ(refusal_of(text), "campaign.toml:" + std::to_string(line) +
                                  ": session[3].orbits = 0 (must be in [1, 10000])");
}

// --- dispersions ---

TEST(DispersionErrors, NameAKeyOfAnotherLaw) {
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nmean = 1e-6"),
            "campaign.toml:2: dispersion.offcentring_m.mean = 1e-6 (not a key of law uniform, "
            "which has minimum, maximum)");
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m.x]\nlaw = \"fixed\"\nvalue = 1\nminimum = 0"),
            "campaign.toml:4: dispersion.offcentring_m.x.minimum = 0 (not a key of law fixed, "
            "which has value)");
}

TEST(DispersionErrors, NameAMissingKey) {
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nlaw = \"normal\"\nmean = 0"),
            "campaign.toml:1: dispersion.offcentring_m.standard_deviation is missing (law normal "
            "needs it)");
}

TEST(DispersionErrors, NameAnUnknownLaw) {
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nminimum = 0\nlaw = \"gauss\""),
            "campaign.toml:3: dispersion.offcentring_m.law = \"gauss\" (must be \"uniform\", "
            "\"normal\", \"truncated_normal\", \"fixed\" or \"table\")");
}

TEST(DispersionErrors, NameTheLineOfAnInconsistentLaw) {
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m.x]\nmaximum = -1"),
            "campaign.toml:2: dispersion.offcentring_m.x.maximum = -1 (must be > minimum, -2e-05)");
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nmaximum = -1"),
            "campaign.toml:2: dispersion.offcentring_m.maximum = -1 (must be > minimum, -2e-05)");
}

TEST(DispersionErrors, RefuseWhatNoInstrumentHas) {
  const std::string rule = " (must be in [-0.02, 0.02], 1000 times the nominal bound)";
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nmaximum = 0.02"), "");
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m]\nmaximum = 5"),
            "campaign.toml:2: dispersion.offcentring_m.maximum = 5" + rule);
  EXPECT_EQ(refusal_of("[dispersion.offcentring_m.z]\nlaw = \"fixed\"\nvalue = -0.03"),
            "campaign.toml:3: dispersion.offcentring_m.z.value = -0.03" + rule);
}

// --- data files ---

constexpr std::string_view table_law =
    "campaign.runs = 3\n"
    "[dispersion.offcentring_m.x]\n"
    "law = \"table\"\n"
    "file = \"draws.csv\"\n"
    "column = \"a\"\n";

TEST(DataFileErrors, NameWhereAMissingFileIsAskedFor) {
  EXPECT_EQ(refusal_of(table_law),
            "campaign.toml:4: dispersion.offcentring_m.x.file = \"draws.csv\" (cannot be read: No "
            "such file or directory)");
  EXPECT_EQ(refusal_of("[environment]\nkind = \"file\"\nfile = \"env.csv\""),
            "campaign.toml:3: environment.file = \"env.csv\" (cannot be read: No such file or "
            "directory)");
  EXPECT_EQ(refusal_of("[environment]\nkind = \"file\""),
            "campaign.toml:1: environment.file = \"\" (environment.kind = \"file\" needs one)");
  EXPECT_EQ(refusal_of("[environment]\nfile = \"env.csv\""),
            "campaign.toml:2: environment.file = \"env.csv\" (only with environment.kind = "
            "\"file\")");
}

TEST(DataFileErrors, NameTheLineOfAMalformedFile) {
  const test::ScratchFolder folder;
  folder.write("draws.csv", "a\n1\n2\nx\n");
  EXPECT_EQ(refusal_of(table_law, folder), "draws.csv:4: a = \"x\" (must be a number)");
  folder.write("env.csv", "time\n");
  EXPECT_TRUE(refusal_of("[environment]\nkind = \"file\"\nfile = \"env.csv\"", folder)
                  .starts_with("env.csv:1: column 1 is \"time\"; the first line must be time_s,"));
}

TEST(DataFileErrors, NameATableWithFewerRowsThanRuns) {
  const test::ScratchFolder folder;
  folder.write("draws.csv", "a\n1e-5\n0.03\n");
  EXPECT_EQ(refusal_of(table_law, folder),
            "campaign.toml:5: dispersion.offcentring_m.x.column = \"a\" (has 2 rows, 3 runs need "
            "one each)");
  EXPECT_EQ(
      refusal_of(table_law, folder, {.num_runs = 2}),
      "campaign.toml:5: dispersion.offcentring_m.x.column = \"a\" (run 1 has 0.03, must be in "
      "[-0.02, 0.02], 1000 times the nominal bound)");
  folder.write("draws.csv", "a\n1e-5\n2e-5\n");
  EXPECT_EQ(refusal_of(table_law, folder, {.num_runs = 2}), "");
}

}  // namespace
}  // namespace proofmass::coordinator
