#include "coordinator/archive/replayed_spectra.hpp"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/series_reading.hpp"
#include "tests/support/fitted_lines.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class ReplayedSpectra : public test::StoreTest {
 protected:
  Store store_with(const MicroscopeCampaign& campaign) {
    return test::store_of(file(), campaign, test::simulated(campaign));
  }
  [[nodiscard]] static RunSpectra spectra_of(const Store& store) {
    return replayed_spectra(Replay(store), RunIndex{0}, test::never_stopped);
  }
  /// Γ_mes,dx of a session of run 0.
  [[nodiscard]] std::vector<double> differential(const Store& store,
                                                 const std::string& session) const {
    const Replay replay(store);
    const std::vector<std::string> sessions{session}, groups{"modes"};
    const SignalSelection selection(replay.recording(), sessions, groups);
    const RunResult stored = replay.stored_result(RunIndex{0});
    const auto output = hdf5_series(directory() / "run.h5", {store, stored, ""}, selection);
    EXPECT_THAT(replay.run(stored, output.get(), test::never_stopped), IsEmpty());
    return test::series_in(directory() / "run.h5", session + "/modes", "differential_x");
  }
};

/// Amplitudes of lines in a record by least squares of all of them, without a filter.
std::vector<double> amplitudes_in(const std::vector<double>& record, double period_s,
                                  const std::vector<SpectrumLine>& lines) {
  const auto count = static_cast<Eigen::Index>(record.size());
  const auto num_lines = static_cast<Eigen::Index>(lines.size());
  const Eigen::Map<const Eigen::VectorXd> values(record.data(), count);
  Eigen::MatrixXd design(count, 2 * num_lines);
  for (Eigen::Index i = 0; i < num_lines; ++i) {
    const double step =
        2.0 * std::numbers::pi * lines[static_cast<std::size_t>(i)].frequency_hz * period_s;
    const Eigen::ArrayXd phase = step * Eigen::ArrayXd::LinSpaced(count, 0.0, double(count - 1));
    design.col(2 * i) = phase.cos();
    design.col(2 * i + 1) = phase.sin();
  }
  const Eigen::VectorXd solution =
      design.householderQr().solve((values.array() - values.mean()).matrix());
  std::vector<double> amplitudes;
  for (Eigen::Index i = 0; i < num_lines; ++i) {
    amplitudes.push_back(std::hypot(solution(2 * i), solution(2 * i + 1)));
  }
  return amplitudes;
}

/// |H| of the filter of [Hardy2013] section 5.2 at a line, from the analogue sections.
double gain_of(const Scenario& scenario, const Session& session, double frequency_hz) {
  double centre_hz = 0.0;
  for (const LineMultiple& line : session.fit_lines) {
    centre_hz += line_frequency_hz(session, line, scenario.orbit.period_s) /
                 static_cast<double>(session.fit_lines.size());
  }
  const double period_s = scenario.simulation.sample_period_s;
  const auto section = [&](double corner_hz) {
    const std::complex<double> s(0.0, std::tan(std::numbers::pi * frequency_hz * period_s) /
                                          std::tan(std::numbers::pi * corner_hz * period_s));
    return std::pair(s, s * s + std::numbers::sqrt2 * s + 1.0);
  };
  const double ratio = scenario.estimation.band_ratio;
  const auto [high, high_pass] = section(centre_hz / ratio);
  return std::abs(high * high / high_pass / section(centre_hz * ratio).second);
}

// The lines of the estimate by its procedure, step by step: filter, drop the transient, least
// squares; then the filter's gain. The others without a filter.
TEST_F(ReplayedSpectra, HaveTheLinesThatTheEstimationFits) {
  const MicroscopeCampaign campaign = test::quick_campaign(1);
  const Store store = store_with(campaign);
  const RunSpectra spectra = spectra_of(store);
  EXPECT_THAT(spectra.reasons, IsEmpty());
  ASSERT_EQ(spectra.sessions.size(), campaign.scenario.sessions.size());
  for (const std::size_t i : {0U, 4U, 8U}) {
    const Session& session = campaign.scenario.sessions[i];
    const SessionSpectrum& spectrum = spectra.sessions[i];
    EXPECT_EQ(spectrum.session, session.name);
    EXPECT_EQ(spectrum.unit, "m/s²");
    const std::vector<double> record = differential(store, session.name);
    const auto by_estimation = test::fitted_lines(record, campaign.scenario, session);
    const std::vector<double> unfiltered = amplitudes_in(record, 1.0, spectrum.lines);
    ASSERT_EQ(spectrum.lines.size(), by_estimation.size());
    for (std::size_t k = 0; k < spectrum.lines.size(); ++k) {
      const SpectrumLine& line = spectrum.lines[k];
      EXPECT_EQ(line.is_used, k < session.fit_lines.size());
      const double amplitude =
          line.is_used
              ? std::abs(by_estimation[k]) / gain_of(campaign.scenario, session, line.frequency_hz)
              : unfiltered[k];
      EXPECT_NEAR(line.amplitude / amplitude, 1.0, 1e-5) << session.name << " " << k;
    }
  }
}

/// The largest measured or remaining density within 2.5 bins of a frequency.
double peak_at(const SessionSpectrum& spectrum, double frequency_hz, double SpectrumPoint::*density,
               double bin_hz) {
  double peak = 0.0;
  for (const SpectrumPoint& point : spectrum.points) {
    if (std::abs(point.frequency_hz - frequency_hz) > 2.5 * bin_hz) continue;
    peak = std::max(peak, point.*density);
  }
  return peak;
}

// Between two bins a Hann window loses at most 1.42 dB, a factor of 0.849 in amplitude. With so
// little noise the subtraction leaves less than a hundredth of a line.
TEST_F(ReplayedSpectra, ShowALineOfItsHeightAndNoneWithoutIt) {
  MicroscopeCampaign campaign = test::quick_campaign(1);
  campaign.scenario.noise.scale = 1e-3;
  const Store store = store_with(campaign);
  const RunSpectra spectra = spectra_of(store);
  const double duration_s = 29160.0;  // Of 29750 samples.
  std::size_t num_lines = 0;
  for (const SessionSpectrum& spectrum : spectra.sessions) {
    for (const SpectrumLine& line : spectrum.lines) {
      EXPECT_NEAR(line.height / (line.amplitude * std::sqrt(duration_s / 3.0)), 1.0, 1e-12);
      const double measured =
          peak_at(spectrum, line.frequency_hz, &SpectrumPoint::measured, 1.0 / duration_s);
      if (!line.is_used || line.height < 5e-11) continue;
      ++num_lines;
      EXPECT_GT(measured, 0.84 * line.height) << spectrum.session;
      EXPECT_LT(measured, 1.01 * line.height) << spectrum.session;
      EXPECT_LT(peak_at(spectrum, line.frequency_hz, &SpectrumPoint::residual, 1.0 / duration_s),
                0.01 * line.height)
          << spectrum.session;
    }
  }
  EXPECT_GE(num_lines, 5U);
}

TEST_F(ReplayedSpectra, LieOnTheNoiseModel) {
  const Store store = store_with(test::quick_campaign(1));
  for (const SessionSpectrum& spectrum : spectra_of(store).sessions) {
    ASSERT_TRUE(spectrum.noise_ratio) << spectrum.session;
    EXPECT_NEAR(spectrum.noise_ratio->value, 1.0, 4.0 * spectrum.noise_ratio->standard_error)
        << spectrum.session;
  }
}

TEST_F(ReplayedSpectra, HaveBandsInTheOrderOfFrequenciesUpToHalfTheRate) {
  const Store store = store_with(test::quick_campaign(1));
  for (const SessionSpectrum& spectrum : spectra_of(store).sessions) {
    EXPECT_TRUE(std::ranges::is_sorted(spectrum.points, {}, &SpectrumPoint::frequency_hz));
    EXPECT_LT(spectrum.points.size(), 300U);
    EXPECT_GT(spectrum.points.back().frequency_hz, 0.47);
    EXPECT_LE(spectrum.points.back().frequency_hz, 0.5);
  }
}

TEST_F(ReplayedSpectra, HaveNoRatioWithoutNoise) {
  MicroscopeCampaign campaign = test::quick_campaign(1);
  campaign.scenario.noise.scale = 0.0;
  const Store store = store_with(campaign);
  EXPECT_FALSE(spectra_of(store).sessions.front().noise_ratio.has_value());
}

TEST_F(ReplayedSpectra, AreNoneOfARunThatDiffers) {
  const MicroscopeCampaign campaign = test::quick_campaign(1);
  std::vector<RunResult> results = test::simulated(campaign);
  results[0].estimate[4] = std::nextafter(results[0].estimate[4], 1.0);
  const RunSpectra spectra = spectra_of(test::store_of(file(), campaign, results));
  EXPECT_THAT(spectra.sessions, IsEmpty());
  EXPECT_THAT(spectra.reasons,
              ElementsAre("A replay of run 0 does not give the stored result: 1 of its values "
                          "differs. proofmass verify tells more."));
}

TEST_F(ReplayedSpectra, EndWhenAsked) {
  const Store store = store_with(test::quick_campaign(1));
  EXPECT_THROW((void)replayed_spectra(Replay(store), RunIndex{0}, [] { return true; }),
               Interrupted);
}

/// A review that knows of the worst run alone.
Review review_of_worst(std::optional<RunValue> worst) {
  Review review;
  RequirementAnswer& row = review.matrix.emplace_back();
  row.requirement.subject = Requirement::Subject::all_objectives;
  row.worst = worst;
  return review;
}

TEST_F(ReplayedSpectra, AreOfTheWorstRun) {
  const Store store = store_with(test::quick_campaign(3));
  const RunSpectra spectra =
      worst_run_spectra(store, review_of_worst(RunValue{RunIndex{2}, 0.9}), test::never_stopped);
  EXPECT_EQ(spectra.run, RunIndex{2});
  const RunSpectra own = replayed_spectra(Replay(store), RunIndex{2}, test::never_stopped);
  ASSERT_EQ(spectra.sessions.size(), 11U);
  EXPECT_EQ(spectra.sessions[4].lines[0].amplitude, own.sessions[4].lines[0].amplitude);
}

TEST_F(ReplayedSpectra, SayWhyThereAreNone) {
  { const Store store = store_with(test::quick_campaign(1)); }
  test::change(file(), "UPDATE campaign SET model_version = 'hardy2013-2'");
  const Store store = Store::open_read_only(file());
  EXPECT_THAT(worst_run_spectra(store, review_of_worst({}), test::never_stopped).reasons,
              ElementsAre("No run has an estimate, or no quantity an objective."));
  EXPECT_THAT(
      worst_run_spectra(store, review_of_worst(RunValue{RunIndex{0}, 0.9}), test::never_stopped)
          .reasons,
      ElementsAre("Run 0 cannot be replayed: model_version = hardy2013-2 (must be "
                  "hardy2013-4, the model of this program: others compute other bits)."));
}

TEST_F(ReplayedSpectra, NameTheirCharts) {
  const Store store = store_with(test::quick_campaign(1));
  const std::vector<std::string> names = spectrum_names(Replay(store).recording());
  ASSERT_EQ(names.size(), 11U);
  EXPECT_EQ(names[4], "spectrum:a_c13");
}

}  // namespace
}  // namespace proofmass::coordinator
