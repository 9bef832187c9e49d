#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/skip_for_want.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string text_of_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// 60 runs whose errors are 1e-6, 2e-6 ... in every parameter. The draws are those of the campaign,
/// so that causes can be looked for; sessions are short, as reports simulate the worst run again.
class ReviewCommands : public testing::Test {
 protected:
  void SetUp() override {
    MicroscopeCampaign campaign = hardy2013_campaign();
    campaign.num_runs = 60;
    campaign.scenario.simulation.sample_period_s = 1.0;
    for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
    Store store = Store::create(database_, campaign, canonical_definition(campaign));
    std::vector<Delivery> deliveries;
    for (std::uint64_t run = 0; run < campaign.num_runs; ++run) {
      Delivery delivery{.result = test::zero_result({.run = {run}, .num_draws = 1}),
                        .worker = {1},
                        .attempt = {1}};
      delivery.result.estimate.assign(num_parameters, 1e-6 * static_cast<double>(run + 1));
      deliveries.push_back(delivery);
    }
    store.commit(deliveries);
  }

  void write_requirements(const std::string& requirement) const {
    std::ofstream(requirements_) << "[[requirements]]\nid = \"SYS-1\"\nrequirement = \""
                                 << requirement << "\"\n";
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path database_ = directory_ / "a.db";
  std::filesystem::path requirements_ = directory_ / "r.toml";
  std::filesystem::path output_ = directory_ / "report.html";
};

TEST_F(ReviewCommands, WriteAReport) {
  const test::Answer answer = test::answer_of({"report", database_, "--html", output_});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_EQ(answer.output, "");
  EXPECT_THAT(text_of_file(output_), StartsWith("<!DOCTYPE html>"));
  const test::Answer markdown = test::answer_of({"report", database_, "--markdown", "-"});
  EXPECT_THAT(markdown.output, StartsWith("# Campaign hardy2013\n"));
}

TEST_F(ReviewCommands, ReplaceAFileOnlyByForce) {
  std::ofstream(output_) << "mine";
  const test::Answer refused = test::answer_of({"report", database_, "--html", output_});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error,
            "output = " + output_.string() + " (exists already; replace it with --force)");
  EXPECT_EQ(text_of_file(output_), "mine");
  EXPECT_EQ(test::answer_of({"report", database_, "--html", output_, "--force"}).exit_code,
            exit_done);
  EXPECT_THAT(text_of_file(output_), StartsWith("<!DOCTYPE html>"));
}

TEST_F(ReviewCommands, WriteOneTextToStandardOutput) {
  const auto misuse = [&](const std::vector<std::string>& outputs) {
    std::vector<std::string> arguments{"report", database_};
    arguments.insert(arguments.end(), outputs.begin(), outputs.end());
    const test::Answer answer = test::answer_of(arguments);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    EXPECT_EQ(answer.output, "");
    return answer.error;
  };
  EXPECT_EQ(misuse({"--html", "-", "--markdown", "-"}),
            "markdown = - (standard output is already taken by --html)");
  EXPECT_EQ(misuse({"--markdown", "-", "--json"}),
            "markdown = - (standard output is already taken by --json)");
  EXPECT_EQ(test::answer_of({"report", database_, "--html", output_, "--markdown", "-"}).exit_code,
            exit_done);
}

TEST_F(ReviewCommands, TakeRequirementsOfAFile) {
  write_requirements("a_c12 < 61e-6 for 95% with 95%");
  EXPECT_EQ(test::answer_of({"report", database_, "--requirements", requirements_}).exit_code,
            exit_done);
  write_requirements("a_c12 < 30e-6 for 95% with 95%");
  EXPECT_EQ(test::answer_of({"report", database_, "--requirements", requirements_}).exit_code,
            exit_not_met);
  const test::Answer html =
      test::answer_of({"report", database_, "--requirements", requirements_, "--html", "-"});
  EXPECT_EQ(html.exit_code, exit_not_met);
  EXPECT_THAT(html.output, HasSubstr("<th scope=\"row\" class=\"words\">SYS-1</th>"));
}

TEST_F(ReviewCommands, RefuseRequirementsTwice) {
  write_requirements("a_c12 < 61e-6 for 95% with 95%");
  const test::Answer refused =
      test::answer_of({"report", database_, "--requirements", requirements_, "--requirement", "x"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "requirement = x (must not be given with --requirements)");
}

TEST_F(ReviewCommands, RefuseARequirementThatCannotBeReadInAReportToo) {
  const test::Answer refused =
      test::answer_of({"report", database_, "--html", "-", "--requirement", "a_c12 is small"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_THAT(refused.error, StartsWith("requirement = a_c12 is small (must read"));
}

TEST_F(ReviewCommands, RefuseADocumentFromACoordinator) {
  const test::Answer refused =
      test::answer_of({"report", "a", "--html", "-", "--connect", "ipc:///nowhere"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_THAT(refused.error, HasSubstr("fetch the database first"));
}

TEST_F(ReviewCommands, HaveTheMatrixInJson) {
  const test::Answer json = test::answer_of({"report", database_, "--json"});
  EXPECT_THAT(json.output, HasSubstr("\"matrix\": ["));
  EXPECT_THAT(json.output, HasSubstr("\"interpretation\": \"mixed\""));
}

TEST_F(ReviewCommands, PlotAPicture) {
  const std::filesystem::path svg = directory_ / "a.svg";
  const test::Answer answer =
      test::answer_of({"plot", database_, "--chart", "histogram:a_c12", "--output", svg});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_THAT(text_of_file(svg), StartsWith("<svg xmlns=\"http://www.w3.org/2000/svg\""));
  EXPECT_EQ(
      test::answer_of({"plot", database_, "--chart", "histogram:a_c12", "--output", "-"}).output,
      text_of_file(svg));
}

TEST_F(ReviewCommands, ListAllCharts) {
  const std::string names = test::answer_of({"plot", database_, "--list"}).output;
  EXPECT_THAT(names, StartsWith("errors\nconvergence\nhistogram:a_c11_delta_x\n"));
  EXPECT_THAT(names, HasSubstr("\nbudget\n"));
  EXPECT_THAT(names, HasSubstr("\nspectrum:a_c13\n"));
}

// The results of this file are made up: a replay finds others.
TEST_F(ReviewCommands, SayWhyTheWorstRunHasNoSpectra) {
  const std::string reason =
      "A replay of run 59 does not give the stored result: 21 of its values differ. proofmass "
      "verify tells more.";
  const test::Answer html = test::answer_of({"report", database_, "--html", "-"});
  EXPECT_THAT(html.output, HasSubstr("<p>" + reason + "</p>"));
  const test::Answer refused =
      test::answer_of({"plot", database_, "--chart", "spectrum:a_c13", "--output", "-"});
  EXPECT_EQ(refused.exit_code, exit_cannot_be_done);
  EXPECT_EQ(refused.error, "chart = spectrum:a_c13 (" + reason + ")");
  EXPECT_EQ(
      test::answer_of({"plot", database_, "--chart", "spectrum:a_c99", "--output", "-"}).error,
      "this campaign has no chart spectrum:a_c99; --list names those that it has");
}

TEST_F(ReviewCommands, RefuseAChartThatIsNone) {
  const test::Answer refused =
      test::answer_of({"plot", database_, "--chart", "pie\x1b", "--output", "-"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "this campaign has no chart pie\\u001b; --list names those that it has");
  EXPECT_EQ(test::answer_of({"plot", database_, "--output", "-"}).error,
            "chart = (must be given; --list names all)");
  EXPECT_EQ(test::answer_of({"plot", database_, "--chart", "errors"}).error,
            "output = (must be given)");
  EXPECT_EQ(test::answer_of({"plot", database_, "--chart", "errors", "--output", "a.gif"}).error,
            "output = a.gif (must end in .svg or .png, or be - for SVG on standard output)");
}

TEST_F(ReviewCommands, PlotABitmap) {
  if (std::system("command -v rsvg-convert > /dev/null") != 0) {
    test::skip_for_want("no rsvg-convert");
    return;
  }
  const std::filesystem::path png = directory_ / "a.png";
  const test::Answer answer =
      test::answer_of({"plot", database_, "--chart", "errors", "--output", png});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_THAT(text_of_file(png), StartsWith("\x89PNG"));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "a.png.svg-draft"));
}

TEST_F(ReviewCommands, SayThatTheConverterIsMissing) {
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", (directory_ / "nothing").c_str(), 1);
  const std::filesystem::path png = directory_ / "a.png";
  const test::Answer refused =
      test::answer_of({"plot", database_, "--chart", "errors", "--output", png});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "output = " + png.string() +
                               " (rsvg-convert is not installed; install the package "
                               "librsvg2-bin, or write .svg)");
  EXPECT_FALSE(std::filesystem::exists(png));
}

}  // namespace
}  // namespace proofmass::coordinator
