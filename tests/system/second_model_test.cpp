// A campaign of a model that is not MICROSCOPE's, through all that runs campaigns and reads them:
// the oscillator of tests/support/oscillator, whose estimates have closed forms.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "core/math/elementary.hpp"
#include "tests/coordinator/archive/series_reading.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/system/process.hpp"
#include "tests/system/stored_runs.hpp"

namespace proofmass::test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using Arguments = std::vector<std::string>;

const std::string programs = PROOFMASS_OSCILLATOR_PROGRAMS;
constexpr std::size_t num_runs = 200;

/// Lines of a CSV end with a carriage return and a line feed.
std::string with_plain_ends(std::string text) {
  std::erase(text, '\r');
  return text;
}

/// A directory with the example of the model, and its programs.
class SecondModel : public testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(proofmass("init", {"init", "example.toml"}), 0); }

  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return directory / name;
  }
  [[nodiscard]] int proofmass(const std::string& name, const Arguments& arguments) const {
    return Process(directory / "", name, programs + "/proofmass", arguments).wait();
  }
  [[nodiscard]] std::string output_of(const std::string& name) const {
    return read_file(path(name + ".out"));
  }
  [[nodiscard]] std::string errors_of(const std::string& name) const {
    return read_file(path(name + ".err"));
  }
  /// The example as NAME.db, by two workers.
  void run(const std::string& name, const Arguments& further = {}) const {
    Arguments arguments{"run",    "example.toml",           "--db",      name + ".db",
                        "--runs", std::to_string(num_runs), "--workers", "2"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    ASSERT_EQ(proofmass(name, arguments), 0) << errors_of(name);
  }
  [[nodiscard]] double number(const std::string& name, const std::string& query) const {
    return std::stod(stored_text(path(name + ".db"), "SELECT printf('%!.17g', (" + query + "))"));
  }
  [[nodiscard]] std::string answer(const std::string& sql) const {
    EXPECT_EQ(proofmass("query", {"query", "a.db", sql, "--format", "csv"}), 0)
        << errors_of("query");
    return with_plain_ends(output_of("query"));
  }

  TemporaryDirectory directory;
};

/// The line `Digest ...` of a report.
std::string digest_in(const std::string& report) {
  std::smatch match;
  EXPECT_TRUE(std::regex_search(report, match, std::regex("Digest +(\\S+)"))) << report;
  return match[1];
}

// Without noise a sum of N products is exact but for rounding: N roundings of partial sums, each at
// most N/2 of the amplitude, so that an error is below N 2⁻⁵³ amplitudes, and as much again for the
// products and the sine. N is 16,000, an amplitude below 3.9e-7 m/s².
TEST_F(SecondModel, FindsTheTruthIfThereIsNoNoise) {
  run("a", {"--set", "sensor.noise_m_s2=0"});
  const double bound = 2.0 * 16000.0 * std::ldexp(3.9e-7, -53);
  for (const std::string quantity : {"in_phase", "quadrature"}) {
    const std::string error = "abs(estimate_" + quantity + "_m_s2 - truth_" + quantity + "_m_s2)";
    EXPECT_LT(number("a", "SELECT max(" + error + ") FROM run_result"), bound) << quantity;
    EXPECT_GT(number("a", "SELECT min(abs(truth_" + quantity + "_m_s2)) FROM run_result"), 1e-9);
  }
}

// The deviation of either error is σ √(2/N), here 1e-9 √(2/16000) = 1.118e-11 m/s². That of 200
// errors has a relative standard error of 1/√400 = 5 %, and their mean one of 1/√200 = 7.1 % of the
// deviation; four of each are allowed.
TEST_F(SecondModel, ErrsAsTheClosedFormSays) {
  run("a");
  const double deviation = 1e-9 * std::sqrt(2.0 / 16000.0);
  for (const std::string quantity : {"in_phase", "quadrature"}) {
    const std::string row = " FROM parameter_accuracy WHERE parameter = '" + quantity + "'";
    EXPECT_NEAR(number("a", "SELECT error_standard_deviation * 1e20" + row) / (deviation * 1e20),
                1.0, 4.0 * 0.05);
    EXPECT_LT(std::abs(number("a", "SELECT bias * 1e20" + row)), 4.0 * 0.071 * deviation * 1e20);
  }
  for (const std::string which : {"min", "max"}) {
    EXPECT_NEAR(
        number("a", "SELECT " + which + "(standard_error_quadrature_m_s2) * 1e11 FROM run_result"),
        deviation * 1e11, 1e-13);
  }
}

TEST_F(SecondModel, IsCheckedInItsOwnSteps) {
  ASSERT_EQ(proofmass("check", {"check", "example.toml", "--runs", "7"}), 0) << errors_of("check");
  EXPECT_THAT(output_of("check"), HasSubstr("Runs      7 of 1000 periods\n"));
}

TEST_F(SecondModel, LosesRunsThatLeaveTheRangeOfTheSensor) {
  run("a", {"--set", "sensor.range_m_s2=3.35e-7"});
  const double num_lost = number("a", "SELECT count(*) FROM run_result WHERE status = 5");
  EXPECT_GT(num_lost, 0.0);
  EXPECT_LT(num_lost, 200.0);
  EXPECT_EQ(number("a",
                   "SELECT count(*) FROM loop_health WHERE peak_reading_m_s2 > 3.35e-7 AND "
                   "loss_cause = 'out_of_range' AND loss_session = 'steady_state'"),
            num_lost);
  EXPECT_EQ(proofmass("verify", {"verify", "a.db", "--fraction", "1"}), 0) << output_of("verify");
}

/// Words of MICROSCOPE's that a text has. Only a model knows what its campaigns are about.
std::vector<std::string> foreign_words_in(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  std::vector<std::string> words;
  for (const std::string word :
       {"hardy", "calibration", "microscope", "equivalence", "environment_row", "a_c1", "k2d"}) {
    if (text.find(word) != std::string::npos) words.push_back(word);
  }
  return words;
}

TEST_F(SecondModel, SaysInHelpWhatItsOwnCampaignsAreFor) {
  ASSERT_EQ(proofmass("help", {"--help"}), 0);
  const std::string help = output_of("help");
  EXPECT_THAT(help, StartsWith("Measures how well a driven oscillator is known"));
  EXPECT_THAT(foreign_words_in(help), IsEmpty());
  const std::string list = help.substr(help.find("\nRun a campaign:\n"));
  const std::regex command("\n  ([a-z-]+) ");
  for (std::sregex_iterator it(list.begin(), list.end(), command), end; it != end; ++it) {
    const std::string name = (*it)[1];
    ASSERT_EQ(proofmass(name, {name, "--help"}), 0);
    EXPECT_THAT(foreign_words_in(output_of(name)), IsEmpty()) << name;
  }
  EXPECT_THAT(output_of("init"), HasSubstr("FILE.toml=oscillator.toml"));
  EXPECT_THAT(output_of("run"), HasSubstr("\"std(in_phase) within 5%\""));
  EXPECT_THAT(output_of("report"), HasSubstr("\"in_phase < 1e-9 for 99% with 95%\""));
  ASSERT_EQ(proofmass("write", {"init"}), 0);
  EXPECT_EQ(output_of("write"), "wrote oscillator.toml\n");
}

TEST_F(SecondModel, IsReportedInNoWordsOfTheOtherModel) {
  run("a");
  ASSERT_EQ(proofmass("report", {"report", "a.db"}), 0) << errors_of("report");
  EXPECT_THAT(output_of("report"), HasSubstr("; the paper: made up for tests\n"));
  ASSERT_EQ(proofmass("html", {"report", "a.db", "--html", "-"}), 0) << errors_of("html");
  ASSERT_EQ(proofmass("markdown", {"report", "a.db", "--markdown", "-"}), 0);
  EXPECT_THAT(output_of("markdown"), StartsWith("# Campaign oscillator\n"));
  for (const std::string report : {"report", "html", "markdown"}) {
    EXPECT_THAT(foreign_words_in(output_of(report)), IsEmpty()) << report;
  }
  EXPECT_THAT(foreign_words_in(
                  stored_text(path("a.db"), "SELECT group_concat(sql, ';') FROM sqlite_schema")),
              IsEmpty());
}

TEST_F(SecondModel, HasOneDigestWhateverIsKilled) {
  const Arguments slow{"--set", "sensor.periods=20000"};
  run("alone", slow);
  std::string text = read_file(path("example.toml"));
  text = std::regex_replace(text, std::regex("periods = [0-9]+"), "periods = 20000");
  text = std::regex_replace(text, std::regex("runs = [0-9]+"), "runs = 200");
  std::ofstream(path("slow.toml")) << text;
  const std::string endpoint = "ipc://" + path("socket").string();
  const auto start = [&](const std::string& name, const Arguments& arguments) {
    return Process(
        directory / "", name,
        programs + (name == "coordinator" ? "/proofmass-coordinator" : "/proofmass-worker"),
        arguments);
  };
  const Arguments serve{"slow.toml", "--directory", "served",
                        "--bind",    endpoint,      "--exit-when-done"};
  Process first = start("first", {"--connect", endpoint, "--name", "first", "--threads", "1"});
  Process second = start("second", {"--connect", endpoint, "--name", "second", "--threads", "1"});
  {
    Process coordinator = start("coordinator", serve);
    wait_until("stored runs", [&] { return num_stored(path("served/oscillator.db")) >= 8; });
    first.signal(SIGKILL);
    EXPECT_EQ(first.wait(), -SIGKILL);
    coordinator.signal(SIGKILL);
    EXPECT_EQ(coordinator.wait(), -SIGKILL);
  }
  ASSERT_LT(num_stored(path("served/oscillator.db")), num_runs);
  Process coordinator = start("coordinator", serve);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(proofmass("report", {"report", "served/oscillator.db"}), 0) << errors_of("report");
  EXPECT_EQ(digest_in(output_of("report")), digest_in(output_of("alone")));
  EXPECT_EQ(stored_runs(path("served/oscillator.db")), stored_runs(path("alone.db")));
}

TEST_F(SecondModel, IsReportedAndAnswersQueries) {
  run("a");
  ASSERT_EQ(proofmass("report", {"report", "a.db"}), 0) << errors_of("report");
  const std::string report = output_of("report");
  EXPECT_THAT(report, HasSubstr("nm/s²"));
  EXPECT_TRUE(std::regex_search(report, std::regex("\nP +nm/s²"))) << report;
  EXPECT_TRUE(std::regex_search(report, std::regex("\nQ +nm/s²"))) << report;
  EXPECT_THAT(report, Not(HasSubstr("udget")));
  const std::string met = "in_phase < 1e-10 for 90% with 95%",
                    broken = "in_phase < 1e-12 for 90% with 95%";
  EXPECT_EQ(proofmass("met", {"report", "a.db", "--requirement", met}), 0) << errors_of("met");
  EXPECT_EQ(proofmass("broken", {"report", "a.db", "--requirement", broken}), 3);
  EXPECT_EQ(answer("SELECT parameter, objective IS NULL, paper_worst IS NULL FROM "
                   "parameter_accuracy"),
            "parameter,objective IS NULL,paper_worst IS NULL\nin_phase,0,0\nquadrature,1,1\n");
  EXPECT_EQ(answer("SELECT count(*) AS n FROM error_long"), "n\n400\n");
  EXPECT_EQ(answer("SELECT count(*) AS n FROM loop_health WHERE peak_reading_m_s2 > 2.8e-7"),
            "n\n200\n");
  EXPECT_EQ(
      answer("SELECT quantity, count(*) AS n FROM draw WHERE value BETWEEN CASE quantity WHEN "
             "'scale_factor' THEN 0.99 ELSE 0.019 END AND CASE quantity WHEN 'scale_factor' "
             "THEN 1.01 ELSE 0.021 END GROUP BY quantity"),
      "quantity,n\nnatural_frequency_hz,200\nscale_factor,200\n");
  EXPECT_EQ(answer("SELECT value FROM definition_entry WHERE key = 'sensor.periods'"),
            "value\n1000\n");
  EXPECT_EQ(proofmass("verify", {"verify", "a.db", "--fraction", "1"}), 0) << output_of("verify");
  EXPECT_THAT(output_of("verify"), HasSubstr("200 of 200 runs simulated again"));
  ASSERT_EQ(proofmass("sensitivity", {"sensitivity", "a.db", "--rows", "2"}), 0)
      << errors_of("sensitivity");
  EXPECT_THAT(output_of("sensitivity"), HasSubstr("scale_factor"));
  EXPECT_THAT(output_of("sensitivity"), HasSubstr("natural_frequency_hz"));
  ASSERT_EQ(proofmass("html", {"report", "a.db", "--html", "-"}), 0) << errors_of("html");
  EXPECT_THAT(output_of("html"), HasSubstr(">|error| of P, for 95 % with 90 %<"));
  EXPECT_THAT(output_of("html"), HasSubstr("id=\"histogram-quadrature-title\""));  // No objective.
  ASSERT_EQ(proofmass("plot", {"plot", "a.db", "--list"}), 0) << errors_of("plot");
  EXPECT_THAT(output_of("plot"), HasSubstr("error:in_phase\n"));
}

// P = (2/N) Σ y cos ωt, added up in the order of the samples: the replayed readings have the bits
// of the stored estimate.
TEST_F(SecondModel, IsReplayedToTheBit) {
  run("a");
  ASSERT_EQ(proofmass("replay", {"replay", "a.db", "--run", "42", "--output", "run42.h5"}), 0)
      << errors_of("replay");
  EXPECT_EQ(output_of("replay"),
            "run 42 completed: all values equal the stored ones\nwrote run42.h5\n");
  const auto read = description_of_series(path("run42.h5"));
  EXPECT_EQ(read["attributes"]["name"], "oscillator");
  EXPECT_EQ(read["sessions"]["steady_state"]["datasets"].size(), 2U);
  const std::string sensor = "steady_state/sensor";
  const std::vector<double> time_s = series_in(path("run42.h5"), sensor, "time");
  const std::vector<double> reading = series_in(path("run42.h5"), sensor, "reading");
  ASSERT_EQ(reading.size(), 16000U);
  EXPECT_EQ(time_s.at(3), 3 * 6.25);  // 16 samples a period of 100 s.
  double in_phase = 0.0;
  for (std::size_t k = 0; k < reading.size(); ++k) {
    in_phase += reading[k] * sincos_turns(static_cast<double>(k % 16) / 16.0).cosine;
  }
  EXPECT_EQ(2.0 / 16000.0 * in_phase,
            number("a", "SELECT estimate_in_phase_m_s2 FROM run_result WHERE run_index = 42"));
  EXPECT_EQ(proofmass("worst", {"replay", "a.db", "--worst", "2", "--output", "worst"}), 0)
      << errors_of("worst");
  const std::string rows = answer(
      "SELECT 'run' || run_index || '.h5' AS file FROM worst_runs WHERE parameter = 'in_phase' "
      "AND place = 1");
  const std::string heading = "file\n";
  const std::string worst = rows.substr(heading.size(), rows.size() - heading.size() - 1);
  EXPECT_TRUE(std::filesystem::exists(path("worst") / worst)) << rows;
}

// White noise, and a line whose amplitude the run itself estimates: both fits have the noise of
// one sample, σ √(2/N), in each of cosine and sine, of which four together are allowed.
TEST_F(SecondModel, HasTheSpectrumOfItsWorstRunInTheReport) {
  run("a");
  ASSERT_EQ(proofmass("html", {"report", "a.db", "--html", "-"}), 0) << errors_of("html");
  const std::string html = output_of("html");
  std::smatch match;
  ASSERT_TRUE(std::regex_search(html, match, std::regex("noise is ([0-9.]+) ± ([0-9.]+) times")));
  EXPECT_NEAR(std::stod(match[1]), 1.0, 4.0 * std::stod(match[2]) + 0.01);
  const std::regex line(
      ">steady_state</th><td data-value=\"0.01\">10</td><td data-value=\"([^\"]+)\">");
  ASSERT_TRUE(std::regex_search(html, match, line));
  const double amplitude =
      number("a",
             "SELECT sqrt(estimate_in_phase_m_s2 * estimate_in_phase_m_s2 + "
             "estimate_quadrature_m_s2 * estimate_quadrature_m_s2) FROM run_result JOIN "
             "worst_runs USING (run_index) WHERE parameter = 'in_phase' AND place = 1");
  EXPECT_NEAR(std::stod(match[1]), amplitude, 4.0 * 1e-9 * std::sqrt(2.0 / 16000.0));
}

TEST_F(SecondModel, HasNoSpectrumOfASessionThatIsTooLong) {
  ASSERT_EQ(proofmass("a", {"run", "example.toml", "--db", "a.db", "--runs", "1", "--workers", "1",
                            "--set", "sensor.periods=600000"}),
            0)
      << errors_of("a");
  ASSERT_EQ(proofmass("html", {"report", "a.db", "--html", "-"}), 0) << errors_of("html");
  EXPECT_THAT(output_of("html"),
              HasSubstr("Session steady_state has 9600000 samples, and spectra are computed of "
                        "8388608 at most."));
}

TEST_F(SecondModel, IsSwept) {
  ASSERT_EQ(proofmass("sweep", {"sweep", "example.toml", "--vary", "sensor.noise_m_s2=1e-9,1e-8",
                                "--runs", "32", "--directory", "swept"}),
            0)
      << errors_of("sweep");
  const std::string text = output_of("sweep");
  EXPECT_THAT(text, HasSubstr("\nsensor.noise_m_s2          1e-9   A\n"
                              "                           1e-8   B\n"));
  ASSERT_EQ(proofmass("again", {"compare", "swept/example-sensor.noise_m_s2=1e-9.db",
                                "swept/example-sensor.noise_m_s2=1e-8.db"}),
            0)
      << errors_of("again");
  // A quantity has no objective: no run is beyond it.
  EXPECT_THAT(text, HasSubstr(" -\n"));
}

TEST_F(SecondModel, IsComparedAndExported) {
  run("a");
  run("b", {"--seed", "2"});
  ASSERT_EQ(proofmass("compare", {"compare", "a.db", "b.db"}), 0) << errors_of("compare");
  EXPECT_THAT(output_of("compare"), HasSubstr("seed"));
  ASSERT_EQ(proofmass("csv", {"query", "a.db", "SELECT * FROM run_result", "--format", "csv"}), 0);
  const std::string csv = with_plain_ends(output_of("csv"));
  EXPECT_THAT(csv.substr(0, csv.find('\n')), HasSubstr("standard_error_quadrature_m_s2"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 201);
  ASSERT_EQ(proofmass("hdf5", {"export", "a.db", "--draws", "--output", "a.h5"}), 0)
      << errors_of("hdf5");
  EXPECT_THAT(read_file(path("a.h5")), HasSubstr("standard_error"));
  EXPECT_THAT(read_file(path("a.h5")), HasSubstr("natural_frequency_hz"));
}

}  // namespace
}  // namespace proofmass::test
