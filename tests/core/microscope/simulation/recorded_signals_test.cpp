#include "core/microscope/simulation/recorded_signals.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "core/microscope/simulation/run.hpp"

namespace proofmass {
namespace {

MicroscopeCampaign short_campaign() {
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
  const Recording recording = recording_of(short_campaign().scenario);
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
  (void)RunPlan(short_campaign()).observe(RunIndex{1}, {}, [&](const ObservedSample& sample) {
    const SatelliteMotion<double> motion =
        sample.loop.motion(sample.constants, sample.shared, sample.noise);
    for (std::size_t k = 0; k < 2; ++k) {
      const double x =
          kinematic_acceleration(sample.constants.sensors[k], motion, sample.shared.mass_motion).x;
      ++num_samples;
      if (x == sample.observation.kinematic_S_x[k]) ++num_equal;
    }
  });
  EXPECT_EQ(num_samples, 11U * 2U * (100U + 2U * 5950U));
  EXPECT_EQ(num_equal, num_samples);
}

TEST(Replay, PassesTheRecordsAndReturnsTheResultOfTheRun) {
  const RunPlan plan(short_campaign());
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

}  // namespace
}  // namespace proofmass
