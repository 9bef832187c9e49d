// Loops from well inside to well beyond their limits of stability, and noise from nominal to far
// beyond it: a run is completed with errors that its noise explains, or its status says why not.

#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/support/spin_sessions.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::size_t num_drawn_runs = batch_lanes;

/// The paper's campaign in sessions of two orbits, which cost a seventh.
MicroscopeCampaign short_campaign(double sample_period_s) {
  MicroscopeCampaign campaign;
  campaign.seed = 11;
  campaign.scenario.simulation.sample_period_s = sample_period_s;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
  return campaign;
}

std::vector<RunResult> simulate(const MicroscopeCampaign& campaign) {
  campaign.validate();
  return test::simulated(RunPlan(campaign), num_drawn_runs);
}

/// Multiplies the gain of every thruster axis.
void set_thrust_gain(MicroscopeCampaign& campaign, double gain) {
  for (const char* const axis : {"x", "y", "z"}) {
    test::fix(campaign, std::string("thruster_scale_error.") + axis, gain - 1.0);
  }
}

/// What the errors of stable loops are made of: of each run without noise, and the standard
/// deviation that nominal noise adds.
struct Baseline {
  explicit Baseline(double sample_period_s) {
    MicroscopeCampaign campaign = short_campaign(sample_period_s);
    const std::vector<RunResult> noisy = simulate(campaign);
    campaign.scenario.noise.scale = 0.0;
    silent = simulate(campaign);
    for (std::size_t p = 0; p < num_parameters; ++p) {
      double squares = 0.0;
      for (std::size_t i = 0; i < num_drawn_runs; ++i) {
        const double noise = noisy[i].estimate[p] - silent[i].estimate[p];
        squares += noise * noise;
      }
      deviation[p] = std::sqrt(squares / num_drawn_runs);
    }
  }

  std::vector<RunResult> silent;
  ParameterArray deviation{};
};

class Stability : public testing::Test {
 protected:
  /// A sample a second takes a quarter of the time of the paper's four, which decide how much noise
  /// loops take in and how fast the environment and an attitude loop may be.
  double sample_period_s_ = 1.0;

  [[nodiscard]] const Baseline& baseline() const {
    static std::map<double, Baseline> baselines;
    return baselines.try_emplace(sample_period_s_, sample_period_s_).first->second;
  }

  /// Six standard deviations of the noise, which 16 runs tell to a fifth, half as much again as the
  /// same instrument leaves without noise, and what every effect may have moved the estimate by.
  [[nodiscard]] double allowance(const MicroscopeCampaign& campaign, const ShiftBounds& bounds,
                                 const RunResult& result, std::size_t parameter) const {
    const RunResult& without_noise = baseline().silent[result.run.value];
    const double systematic =
        std::abs(without_noise.estimate[parameter] - without_noise.truth[parameter]);
    const double objective = campaign.scenario.objectives[parameter];
    double part = 1.0 / 50.0;
    for (const Shift& shift :
         bounds.of(test::health_of(result), result.truth, result.standard_error)) {
      if (index(shift.parameter) == parameter) part += shift.part;
    }
    return 1.1 * 6.0 * campaign.scenario.noise.scale * baseline().deviation[parameter] +
           1.5 * systematic + part * objective;
  }

  /// @returns How many of the runs are completed.
  [[nodiscard]] std::size_t expect_explained(const MicroscopeCampaign& campaign,
                                             const std::string& what) const {
    std::size_t num_completed = 0;
    const std::vector<RunResult> results = simulate(campaign);
    const ShiftBounds bounds(campaign.scenario, campaign.dispersions);
    for (std::size_t i = 0; i < num_drawn_runs; ++i) {
      const RunResult& result = results[i];
      if (result.status == RunStatus::lost) {
        EXPECT_NE(result.loss.cause, static_cast<std::uint32_t>(LossCause::none));
        continue;
      }
      // Where the axes of a weak loop push each other, corrections of one estimate by the others
      // grow.
      if (result.status == RunStatus::not_converged) continue;
      EXPECT_EQ(result.status, RunStatus::completed) << what << ", run " << i;
      ++num_completed;
      for (const test::ParameterInfo& info : test::parameter_infos()) {
        const std::size_t p = index(info.parameter);
        EXPECT_LE(std::abs(result.error(index(info.parameter))),
                  allowance(campaign, bounds, result, p))
            << what << ", run " << i << ", " << info.name;
      }
    }
    return num_completed;
  }

  using Setting = std::function<void(MicroscopeCampaign&, double)>;

  /// Checks values of which no run is lost, values between, and such of which every run is.
  void expect_explained_sweep(const std::string& name, const std::vector<double>& harmless,
                              const std::vector<double>& between, const std::vector<double>& absurd,
                              const Setting& set) const {
    const auto num_completed_at = [&](double value) {
      MicroscopeCampaign campaign = short_campaign(sample_period_s_);
      set(campaign, value);
      return expect_explained(campaign, name + " = " + std::to_string(value));
    };
    for (const double value : harmless) {
      EXPECT_EQ(num_completed_at(value), num_drawn_runs) << name << " = " << value;
    }
    for (const double value : between) (void)num_completed_at(value);
    for (const double value : absurd)
      EXPECT_EQ(num_completed_at(value), 0U) << name << " = " << value;
  }
};

// The loop of one integrator and one sample of delay is stable below 2/(ω_c T) = 6.4 times its
// gain; close to that it rings at half the sample rate, and K2 turns that into noise at the lines.
TEST_F(Stability, OfHighThrustGainIsKeptOrReported) {
  expect_explained_sweep("thrust gain", {2.5, 4.5}, {5.0, 5.5, 5.75, 6.0, 6.25}, {6.5, 10.0},
                         set_thrust_gain);
}

// Below 0.03 times its gain a loop of thrusters that are misaligned by 0.017 rad pushes across as
// much as along, and swings up.
TEST_F(Stability, OfLowThrustGainIsKeptOrReported) {
  expect_explained_sweep("thrust gain", {0.1}, {0.03, 0.02, 0.015}, {0.003, 0.001},
                         set_thrust_gain);
}

TEST_F(Stability, OfThrustAlongOneAxisIsKeptOrReported) {
  expect_explained_sweep("thrust gain along Y", {5.5}, {6.0, 6.25}, {6.5, 10.0},
                         [](MicroscopeCampaign& campaign, double gain) {
                           test::fix(campaign, "thruster_scale_error.y", gain - 1.0);
                         });
}

// The slow integral makes the loop unstable where ω_I is above 2ζω.
TEST_F(Stability, OfTheAttitudeIntegralIsKeptOrReported) {
  expect_explained_sweep("attitude integral", {0.001, 0.002}, {0.0025, 0.003, 0.0035}, {0.0049},
                         [](MicroscopeCampaign& campaign, double integral_hz) {
                           campaign.scenario.attitude.bandwidth_hz = 0.005;
                           campaign.scenario.attitude.damping = 0.3;
                           campaign.scenario.attitude.integral_hz = integral_hz;
                         });
}

// With its integral kept, the loop is unstable below the gain at which 2ζω is ω_I: at 0.0033 Hz.
TEST_F(Stability, OfLowAttitudeGainIsKeptOrReported) {
  expect_explained_sweep("attitude bandwidth", {0.01, 0.005}, {0.0036, 0.0034, 0.0032}, {0.0025},
                         [](MicroscopeCampaign& campaign, double bandwidth_hz) {
                           campaign.scenario.attitude.bandwidth_hz = bandwidth_hz;
                           campaign.scenario.attitude.damping = 0.3;
                           campaign.scenario.attitude.integral_hz = 0.002;
                         });
}

// A loop that does not follow the motion which the session of Δy commands has an angle of that
// size, and estimates that are right.
TEST_F(Stability, OfTheAttitudeGainIsKept) {
  sample_period_s_ = 0.25;
  const auto set = [](MicroscopeCampaign& campaign, double bandwidth_hz) {
    campaign.scenario.attitude.bandwidth_hz = bandwidth_hz;
    campaign.scenario.attitude.integral_hz = 0.0;
  };
  expect_explained_sweep("attitude bandwidth", {0.1, 0.005, 0.002}, {}, {}, set);
}

// The loop takes the thrusters' noise out of the lines, but K2 turns its square into noise there.
TEST_F(Stability, UnderNoiseOfTheThrustersIsKeptOrReported) {
  sample_period_s_ = 0.25;
  expect_explained_sweep("thrust noise", {10.0}, {20.0, 28.0, 40.0}, {100.0},
                         [](MicroscopeCampaign& campaign, double factor) {
                           campaign.scenario.noise.thrust_asd_m_s2 *= factor;
                         });
}

TEST_F(Stability, UnderNoiseIsKeptOrReported) {
  sample_period_s_ = 0.25;
  expect_explained_sweep(
      "noise", {3.0, 6.0}, {10.0, 15.0, 20.0, 30.0}, {100.0, 1000.0},
      [](MicroscopeCampaign& campaign, double scale) { campaign.scenario.noise.scale = scale; });
}

TEST_F(Stability, InAStrongEnvironmentIsKeptOrReported) {
  sample_period_s_ = 0.25;
  expect_explained_sweep("environment", {100.0, 1000.0}, {3000.0}, {30000.0},
                         [](MicroscopeCampaign& campaign, double scale) {
                           campaign.scenario.environment.scale = scale;
                         });
}

// At the rate of the flight the centrifugal acceleration is a part of a_d11' and that of Coriolis
// one of a_c13. Without noise, in sessions of the paper's length, nothing else hides them.
TEST_F(Stability, OfAFrameThatSpinsIsKept) {
  expect_explained_sweep("spin", {4.5, 17.5, -17.5}, {}, {},
                         [](MicroscopeCampaign& campaign, double spin_in_orbits) {
                           campaign.scenario = test::coarse_campaign().scenario;
                           campaign.scenario.noise.scale = 0.0;
                           test::spin_sessions(campaign, spin_in_orbits);
                         });
}

}  // namespace
}  // namespace proofmass
