// What passes an observer is what the run is made of: the paper's estimate of the lines, computed
// from the observed samples step by step, gives the phasors that the run has without them.

#include "core/microscope/simulation/observer.hpp"

#include "core/microscope/session/gaps.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/fitted_lines.hpp"
#include "tests/test.hpp"

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

/// Beside the session's own lines, all signals of the known ones, each among all others.
RecordNeeds all_lines_and_signals(const Session& session) {
  RecordNeeds needs{.signals = SignalSet::all};
  for (const LineSignals signals :
       {LineSignals::gradients, LineSignals::squares, LineSignals::moved}) {
    if (signals == LineSignals::moved && mass_excitation(session) == nullptr) continue;
    needs.lines.push_back({session.known_lines[needs.lines.size()], signals});
  }
  needs.neighbours = session.fit_lines;
  needs.neighbours.insert(needs.neighbours.end(), session.known_lines.begin(),
                          session.known_lines.end());
  return needs;
}
void accept_sessions(const std::vector<Session>& /*sessions*/) {}
Estimation no_estimation(const RunPhasors& /*records*/, const EstimationInput& /*input*/) {
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

struct Observed {
  std::vector<Series> records;
  std::vector<std::int64_t> first, last;  ///< Indices of the samples of each session.
  bool is_in_order = true;
  double latest_s = 0.0;
};

Observed observe(const RunPlan& plan, RunRecord& record) {
  Observed observed;
  record = plan.record(RunIndex{2}, {}, {}, [&](const ObservedSample& sample) {
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

// In a test, and of the run that is observed.
TEST(SampleObserver, KnowsWhatGapsTake) {
  MicroscopeCampaign campaign = short_campaign();
  Session test;
  test.name = "test";
  test.target = SessionTarget::ep_test;
  test.num_orbits = 1;
  campaign.scenario.sessions = {campaign.scenario.sessions[0], test};
  campaign.scenario.gaps = {.glitch_rate_hz = 0.01, .glitch_duration_s = 15.0};
  const RunIndex run{3};
  constexpr std::size_t block = test_block_size, num_blocks = 23800 / block;
  const std::vector<bool> expected =
      lost_blocks(campaign.scenario.gaps, test, campaign.seed, run, num_blocks,
                  campaign.scenario.orbit.period_s, 0.25);
  ASSERT_GT(std::ranges::count(expected, true), 100);
  std::size_t num_wrong = 0;
  (void)RunPlan(campaign).record(run, {}, {}, [&](const ObservedSample& sample) {
    const auto at = static_cast<std::size_t>(sample.index) / block;
    const bool is_of_test = sample.session == 1 && sample.index >= 0 && at < num_blocks;
    if (sample.is_lost != (is_of_test && expected[at])) ++num_wrong;
  });
  EXPECT_EQ(num_wrong, 0U);
}

/// The series of a line's signal in a record, by its place in LinePhasors.
std::vector<double> line_column(const Series& series, LineSignals signals, std::size_t s,
                                const Excitation* moving, double sample_period_s) {
  if (s < num_line_bases) return column(series, static_cast<Signal>(s));
  std::vector<double> values;
  for (std::size_t k = 0; k < series.size(); ++k) {
    const auto at = [&](Signal signal) { return series[k][index(signal)]; };
    if (signals == LineSignals::squares) {
      const double d = at(Signal::differential_x), c = at(Signal::common_x);
      values.push_back(s == num_line_bases ? (c + d) * (c + d) : (c - d) * (c - d));
      continue;
    }
    constexpr std::array elements{Signal::gradient_xx, Signal::gradient_xy, Signal::gradient_xz,
                                  Signal::gradient_yx, Signal::gradient_yy, Signal::gradient_yz,
                                  Signal::gradient_zx, Signal::gradient_zy, Signal::gradient_zz};
    const bool is_moved = signals == LineSignals::moved;
    double value = at(elements[s - num_line_bases + (is_moved ? 0 : 3)]);
    if (is_moved) {
      const double time_s = static_cast<double>(k) * sample_period_s;
      value *= 0.5 * moving->amplitude *
               std::sin(2.0 * std::numbers::pi * moving->frequency_hz * time_s);
    }
    values.push_back(value);
  }
  return values;
}

double size_of(const std::vector<double>& values) {
  const auto [least, most] = std::ranges::minmax_element(values);
  return *most - *least;
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
    const Series& series = observed.records[i];
    ASSERT_EQ(phasors.num_fit_lines, session.fit_lines.size());
    for (const Signal signal : {Signal::differential_x, Signal::gradient_xy, Signal::product,
                                Signal::gradient_yy, Signal::gradient_zz}) {
      const std::vector<double> values = column(series, signal);
      const std::vector<Complex> lines = test::fitted_lines(values, scenario, session);
      for (std::size_t line = 0; line < session.fit_lines.size(); ++line) {
        EXPECT_LE(std::abs(phasors.amplitude[index(signal)][line] - lines[line]),
                  1e-9 * size_of(values))
            << name_of(target) << ", signal " << index(signal) << ", line " << line;
      }
    }
    // The further lines and the level have a fit of their own, behind a low-pass three times above
    // the highest of them.
    const std::vector<WantedLine> wanted = all_lines_and_signals(session).lines;
    ASSERT_EQ(phasors.lines.size(), wanted.size());
    Session alone = session;
    alone.known_lines.insert(alone.known_lines.end(), session.fit_lines.begin(),
                             session.fit_lines.end());
    alone.known_lines.push_back({.orbital = 0.01 / session.num_orbits});
    double highest_hz = 0.0;
    for (const LineMultiple& line : alone.known_lines) {
      highest_hz = std::max(highest_hz, line_frequency_hz(session, line, scenario.orbit.period_s));
    }
    const double period_s = scenario.simulation.sample_period_s;
    const BandPass filter{no_filter.high_pass, butterworth_low_pass(3.0 * highest_hz, period_s)};
    for (std::size_t w = 0; w < wanted.size(); ++w) {
      alone.fit_lines = {wanted[w].line};
      Session others = alone;
      std::erase(others.known_lines, wanted[w].line);
      const std::size_t num_used = num_line_bases + (wanted[w].signals == LineSignals::squares ? 2
                                                     : wanted[w].signals == LineSignals::moved ? 9
                                                                                               : 6);
      for (std::size_t s = 0; s < num_used; s += 3) {
        const std::vector<double> values =
            line_column(series, wanted[w].signals, s, mass_excitation(session), period_s);
        const Complex line = test::fitted_lines(values, scenario, others, filter)[0];
        EXPECT_LE(std::abs(phasors.lines[w][s] - line), 1e-9 * size_of(values))
            << name_of(target) << ", signal " << s << " of line " << w;
      }
    }
    for (std::size_t s = 0; s < num_line_bases; ++s) {
      const std::vector<double> values = column(series, static_cast<Signal>(s));
      double sum = 0.0;
      for (const double value : values) sum += value;
      EXPECT_EQ(phasors.means[s], sum / static_cast<double>(values.size()));
    }
  }
}

TEST(SampleObserver, ChangesNoBitOfTheRun) {
  const RunPlan plan(short_campaign());
  RunRecord observed;
  (void)observe(plan, observed);
  const RunRecord alone = plan.record(RunIndex{2}, {});
  for (std::size_t i = 0; i < alone.phasors.size(); ++i) {
    EXPECT_EQ(observed.phasors[i].amplitude, alone.phasors[i].amplitude);
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
    EXPECT_TRUE(few.phasors[i].lines.empty());
    EXPECT_GE(all.phasors[i].lines.size(), 2U);
    SessionPhasors common = all.phasors[i];
    if (target_info(session.target).signals == SignalSet::common) {
      EXPECT_NE(common.amplitude[index(Signal::gradient_zz)][0], Complex(0.0, 0.0));
      std::fill(common.amplitude.begin() + num_common_signals, common.amplitude.end(),
                decltype(common.amplitude)::value_type{});
    }
    EXPECT_EQ(common.amplitude, few.phasors[i].amplitude);
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
      EXPECT_EQ(batch[1].phasors[i].amplitude, alone.phasors[i].amplitude);
      EXPECT_EQ(batch[1].phasors[i].lines, alone.phasors[i].lines);
      EXPECT_EQ(batch[1].phasors[i].means, alone.phasors[i].means);
    }
  }
}

}  // namespace
}  // namespace proofmass
