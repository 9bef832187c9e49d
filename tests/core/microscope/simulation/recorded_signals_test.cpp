#include "core/microscope/simulation/recorded_signals.hpp"

#include <regex>

#include "core/campaign/recording.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

MicroscopeCampaign campaign_of_two_orbits() {
  MicroscopeCampaign campaign;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
  campaign.validate();
  return campaign;
}

void expect_name(const std::string& name, std::set<std::string>& names) {
  EXPECT_TRUE(std::regex_match(name, std::regex("[A-Za-z0-9_]+"))) << name;
  EXPECT_TRUE(names.insert(name).second) << name;
}

// Names become those of datasets, of their fields and of files.
TEST(RecordedSignals, HaveNamesOfTheirOwnAndKnownFrames) {
  const RunPlan plan(campaign_of_two_orbits());
  const Recording& recording = plan.recording();
  std::set<std::string> frames{""}, groups, sessions;
  for (const RecordedFrame& frame : recording.frames) expect_name(frame.name, frames);
  for (const RecordedSession& session : recording.sessions) expect_name(session.name, sessions);
  for (const SignalGroup& group : recording.groups) {
    expect_name(group.name, groups);
    EXPECT_FALSE(group.meaning.empty());
    std::set<std::string> signals{"time"};
    for (const RecordedSignal& signal : group.signals) {
      expect_name(signal.name, signals);
      EXPECT_TRUE(frames.contains(signal.frame)) << signal.name << " " << signal.frame;
      EXPECT_FALSE(signal.unit.empty() || signal.meaning.empty()) << signal.name;
    }
  }
}

// The loop that an observer sees is that before the sample: from it, the applied accelerations come
// out with the bits that the sample has itself.
TEST(ObservedSample, HasTheLoopThatTheSampleBeganWith) {
  std::size_t num_samples = 0, num_equal = 0;
  (void)RunPlan(campaign_of_two_orbits())
      .record(RunIndex{1}, {}, {}, [&](const ObservedSample& sample) {
        const SatelliteMotion<double> motion =
            sample.loop.motion(sample.constants, sample.shared, sample.noise);
        for (std::size_t k = 0; k < 2; ++k) {
          const double x =
              kinematic_acceleration(sample.constants.sensors[k], motion, sample.shared.mass_motion)
                  .x;
          ++num_samples;
          if (x == sample.observation.kinematic_S_x[k]) ++num_equal;
        }
      });
  EXPECT_EQ(num_samples, 11U * 2U * (100U + 2U * 5950U));
  EXPECT_EQ(num_equal, num_samples);
}

TEST(Replay, PassesTheRecordsAndReturnsTheResultOfTheRun) {
  const RunPlan plan(campaign_of_two_orbits());
  std::size_t num_values = 0;
  for (const SignalGroup& group : plan.recording().groups) num_values += group.signals.size();
  std::vector<std::uint64_t> num_samples(plan.recording().sessions.size());
  bool is_sound = true;
  const SampleSink count = [&](const RecordedSample& sample) {
    is_sound = is_sound && sample.values.size() == num_values &&
               sample.time_s == static_cast<double>(num_samples[sample.session]);
    ++num_samples[sample.session];
  };
  const RunResult replayed = plan.replay({RunIndex{1}, {}}, count);
  EXPECT_TRUE(is_sound);
  for (std::size_t i = 0; i < num_samples.size(); ++i) {
    EXPECT_EQ(num_samples[i], 11900U);  // Two orbits of 5950 s.
    EXPECT_EQ(num_samples[i], plan.recording().sessions[i].num_samples);
  }
  const RunResult simulated = plan.simulate(RunIndex{1}, {});
  EXPECT_EQ(replayed.estimate, simulated.estimate);
  EXPECT_EQ(replayed.health, simulated.health);
  EXPECT_EQ(replayed.status, RunStatus::completed);
}

/// Name of the signal at an index of RecordedSample::values.
std::string name_of_value(const Recording& recording, std::size_t value) {
  for (const SignalGroup& group : recording.groups) {
    if (value < group.signals.size()) return group.name + "/" + group.signals[value].name;
    value -= group.signals.size();
  }
  return "";
}

// The fits together have each line of the session once, those that are fitted first.
TEST(RecordedSignals, ExpectTheLinesOfEachSession) {
  const MicroscopeCampaign campaign = campaign_of_two_orbits();
  const RunPlan plan(campaign);
  const Recording& recording = plan.recording();
  ASSERT_EQ(recording.spectra.size(), campaign.scenario.sessions.size());
  for (std::size_t i = 0; i < recording.spectra.size(); ++i) {
    const ExpectedSpectrum& expected = recording.spectra[i];
    EXPECT_EQ(expected.session, i);
    EXPECT_EQ(name_of_value(recording, expected.value), "modes/differential_x");
    const Session& session = campaign.scenario.sessions[i];
    std::vector<LineMultiple> lines = session.fit_lines;
    lines.insert(lines.end(), session.known_lines.begin(), session.known_lines.end());
    std::vector<double> expected_hz, fitted_hz;
    for (const LineMultiple& line : lines) {
      expected_hz.push_back(line_frequency_hz(session, line, campaign.scenario.orbit.period_s));
    }
    EXPECT_EQ(expected.fits.front().fit_hz.size(), session.fit_lines.size());
    for (const LineFit& fit : expected.fits) {
      EXPECT_EQ(fit.num_samples, recording.sessions[i].num_samples);
      EXPECT_EQ(fit.fit_hz.size() + fit.known_hz.size(), lines.size());
      fitted_hz.insert(fitted_hz.end(), fit.fit_hz.begin(), fit.fit_hz.end());
    }
    EXPECT_EQ(fitted_hz, expected_hz) << session.name;
  }
}

// Half the difference of two independent sensors has half the power of one; the filter that makes
// their noise keeps within 0.5 dB, a factor of 1.122, of the density that it is asked to have.
TEST(RecordedSignals, ExpectTheNoiseOfHalfADifference) {
  MicroscopeCampaign campaign = campaign_of_two_orbits();
  campaign.scenario.noise.scale = 3.0;
  const RunPlan plan(campaign);
  for (const double frequency_hz : {1e-4, 1e-3, 1e-2, 1e-1}) {
    const double asked = 0.5 * 9.0 * nominal_psd(campaign.scenario.noise.linear_x, frequency_hz);
    const double ratio = plan.recording().spectra[4].noise_psd(frequency_hz) / asked;
    EXPECT_GT(ratio, 1.0 / 1.122) << frequency_hz;
    EXPECT_LT(ratio, 1.122) << frequency_hz;
  }
}

}  // namespace
}  // namespace proofmass
