// What passes an observer is what the run is made of: the paper's estimate of the lines, computed
// from the observed samples step by step, gives the phasors that the run has without them.

#include "core/microscope/simulation/observer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <complex>
#include <cstdint>
#include <vector>

#include "core/microscope/simulation/run.hpp"
#include "tests/support/fitted_lines.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

MicroscopeCampaign short_campaign() {
  MicroscopeCampaign campaign;
  campaign.seed = 4;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
  campaign.validate();
  return campaign;
}

RecordNeeds all_lines_and_signals(const Session& /*session*/) {
  return {.lines = RecordedLines::all, .signals = SignalSet::all};
}
void accept_sessions(const std::vector<Session>& /*sessions*/) {}
Estimation no_estimation(const RunPhasors& /*records*/, const std::vector<Session>& /*sessions*/,
                         const EstimationConfig& /*config*/, const ParameterArray& /*objectives*/) {
  return {};
}

/// A method that wants all that can be recorded.
constexpr EstimationMethodInfo recording_method{"recording", all_lines_and_signals, accept_sessions,
                                                no_estimation};

/// The record of one session: [sample][signal].
using Series = std::vector<std::array<double, num_signals>>;

/// One signal of a record.
std::vector<double> column(const Series& series, Signal signal) {
  std::vector<double> values;
  for (const auto& sample : series) values.push_back(sample[index(signal)]);
  return values;
}

/// Largest distance from the mean: what rounding is relative to.
double size_of(const Series& series, Signal signal) {
  const auto [least, most] = std::ranges::minmax_element(
      series, {}, [signal](const auto& sample) { return sample[index(signal)]; });
  return (*most)[index(signal)] - (*least)[index(signal)];
}

struct Observed {
  std::vector<Series> records;
  std::vector<std::int64_t> first, last;  ///< Indices of the samples of each session.
  bool is_in_order = true;
  double latest_s = 0.0;
};

Observed observe(const RunPlan& plan, RunRecord& record) {
  Observed observed;
  record = plan.observe(RunIndex{2}, {}, [&](const ObservedSample& sample) {
    if (sample.session == observed.records.size()) {
      observed.records.emplace_back();
      observed.first.push_back(sample.index);
      observed.last.push_back(sample.index - 1);
    }
    observed.is_in_order = observed.is_in_order && sample.session + 1 == observed.records.size() &&
                           sample.index == observed.last.back() + 1;
    observed.last.back() = sample.index;
    observed.latest_s = std::max(observed.latest_s, sample.time_s);
    if (sample.index >= 0) observed.records.back().push_back(sample.signals);
  });
  return observed;
}

void expect_same_bits(const SessionPhasors& a, const SessionPhasors& b, std::size_t num_lines) {
  for (std::size_t s = 0; s < num_signals; ++s) {
    for (std::size_t i = 0; i < num_lines; ++i) {
      ASSERT_EQ(std::bit_cast<std::uint64_t>(a.amplitude[s][i].real()),
                std::bit_cast<std::uint64_t>(b.amplitude[s][i].real()))
          << "signal " << s << ", line " << i;
      ASSERT_EQ(std::bit_cast<std::uint64_t>(a.amplitude[s][i].imag()),
                std::bit_cast<std::uint64_t>(b.amplitude[s][i].imag()))
          << "signal " << s << ", line " << i;
    }
  }
}

TEST(SampleObserver, GetsEverySampleOfEverySessionInOrder) {
  const MicroscopeCampaign campaign = short_campaign();
  RunRecord record;
  const Observed observed = observe(RunPlan(campaign), record);
  EXPECT_TRUE(observed.is_in_order);
  ASSERT_EQ(observed.records.size(), campaign.scenario.sessions.size());
  for (std::size_t i = 0; i < observed.records.size(); ++i) {
    EXPECT_EQ(observed.first[i], -400) << i;             // 100 s of settling at 4 Hz.
    EXPECT_EQ(observed.records[i].size(), 47600U) << i;  // Two orbits of 5950 s.
  }
  EXPECT_DOUBLE_EQ(observed.latest_s, 47599 * 0.25);
}

// The weights' sums and the step-by-step fit round differently: by some 1e-16 of the signal in each
// of 5e4 samples, times the few hundred by which nearby lines in two orbits amplify it.
TEST(SampleObserver, RecordsTheSeriesWhosePhasorsTheRunHas) {
  const MicroscopeCampaign campaign = short_campaign();
  const Scenario& scenario = campaign.scenario;
  RunRecord record;
  const Observed observed = observe(RunPlan(campaign, recording_method), record);
  for (const SessionTarget target :
       {SessionTarget::a_c11_delta_y, SessionTarget::a_c13, SessionTarget::k2d}) {
    const std::size_t i = index(target);
    const Session& session = scenario.sessions[i];
    const SessionPhasors& phasors = record.phasors[i];
    ASSERT_EQ(phasors.num_fit_lines, session.fit_lines.size());
    ASSERT_EQ(phasors.num_lines, session.fit_lines.size() + session.known_lines.size());
    for (const Signal signal : {Signal::differential_x, Signal::gradient_xy, Signal::product,
                                Signal::gradient_yy, Signal::gradient_zz}) {
      const std::vector<Complex> lines =
          test::fitted_lines(column(observed.records[i], signal), scenario, session);
      const double tolerance = 1e-9 * size_of(observed.records[i], signal);
      for (std::size_t line = 0; line < lines.size(); ++line) {
        EXPECT_LE(std::abs(phasors.amplitude[index(signal)][line] - lines[line]), tolerance)
            << name_of(target) << ", signal " << index(signal) << ", line " << line;
      }
    }
  }
}

TEST(SampleObserver, ChangesNoBitOfTheRun) {
  const RunPlan plan(short_campaign());
  RunRecord observed;
  (void)observe(plan, observed);
  const RunRecord alone = plan.record(RunIndex{2}, {});
  for (std::size_t i = 0; i < alone.phasors.size(); ++i) {
    expect_same_bits(observed.phasors[i], alone.phasors[i], num_session_lines_max);
  }
  const RunResult with = plan.estimate(observed), without = plan.estimate(alone);
  EXPECT_EQ(with.status, RunStatus::completed);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_EQ(std::bit_cast<std::uint64_t>(with.estimate[i]),
              std::bit_cast<std::uint64_t>(without.estimate[i]));
  }
  EXPECT_EQ(with.health, without.health);
}

// Lines and signals that one method wants recorded in addition leave those of another alone.
TEST(RecordNeeds, AddLinesAndChangeNoBitOfTheOthers) {
  const MicroscopeCampaign campaign = short_campaign();
  const RunRecord few = RunPlan(campaign).record(RunIndex{2}, {});
  const RunRecord all = RunPlan(campaign, recording_method).record(RunIndex{2}, {});
  for (std::size_t i = 0; i < few.phasors.size(); ++i) {
    const Session& session = campaign.scenario.sessions[i];
    EXPECT_EQ(few.phasors[i].num_lines, session.fit_lines.size());
    EXPECT_EQ(all.phasors[i].num_lines, session.fit_lines.size() + session.known_lines.size());
    SessionPhasors common = all.phasors[i];
    if (target_info(session.target).signals == SignalSet::common) {
      EXPECT_NE(common.amplitude[index(Signal::gradient_zz)][0], Complex(0.0, 0.0));
      std::fill(common.amplitude.begin() + num_common_signals, common.amplitude.end(),
                decltype(common.amplitude)::value_type{});
    }
    expect_same_bits(common, few.phasors[i], session.fit_lines.size());
  }
}

TEST(RecordNeeds, AreMetByBatchesWithTheBitsOfTheRunAlone) {
  const RunPlan plan(short_campaign(), recording_method);
  const RunRecord alone = plan.record(RunIndex{2}, {});
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    const std::vector<RunRequest> requests{{RunIndex{1}, {}}, {RunIndex{2}, {}}};
    const std::vector<RunRecord> batch = plan.record_batch(requests, set);
    for (std::size_t i = 0; i < alone.phasors.size(); ++i) {
      EXPECT_EQ(batch[1].phasors[i].num_lines, alone.phasors[i].num_lines);
      expect_same_bits(batch[1].phasors[i], alone.phasors[i], num_session_lines_max);
    }
  }
}

}  // namespace
}  // namespace proofmass
