// What holds of the motion that a replayed file shows: equations of [Hardy2013], closed forms of
// the excitations and the spectrum of the noise, computed from nothing but the file and the
// campaign.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "coordinator/archive/replay.hpp"
#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/series_reading.hpp"
#include "tests/support/averaged_spectrum.hpp"
#include "tests/support/fitted_lines.hpp"

namespace proofmass::coordinator {
namespace {

using Series = std::vector<double>;

class ReplayedSeries : public test::StoreTest {
 protected:
  /// Replays run 0 of a campaign into a file.
  void replay(const MicroscopeCampaign& campaign, const std::vector<std::string>& sessions,
              const std::vector<std::string>& groups) {
    const Store store = test::store_of(file(), campaign, test::simulated(campaign));
    const Replay again(store);
    const SignalSelection selection(again.recording(), sessions, groups);
    const RunResult stored = again.stored_result(RunIndex{0});
    const auto output = hdf5_series(series_, {store, stored, ""}, selection);
    ASSERT_TRUE(again.run(stored, output.get(), test::never_stopped).empty());
  }

  [[nodiscard]] Series series(const std::string& dataset, const std::string& field) const {
    return test::series_in(series_, dataset, field);
  }
  /// The vector whose components are named so: `a_c13/applied`, `mass_1_S_`.
  [[nodiscard]] std::vector<Eigen::Vector3d> vectors(const std::string& dataset,
                                                     const std::string& name) const {
    const Series x = series(dataset, name + "x"), y = series(dataset, name + "y"),
                 z = series(dataset, name + "z");
    std::vector<Eigen::Vector3d> all;
    for (std::size_t k = 0; k < x.size(); ++k) all.emplace_back(x[k], y[k], z[k]);
    return all;
  }

 private:
  std::filesystem::path series_ = directory() / "run.h5";
};

/// The drawn vector of that name, in S.
Eigen::Vector3d drawn_vector(const MicroscopeCampaign& campaign, const std::string& name) {
  const std::vector<double> values = campaign.draw(RunIndex{0}).values;
  const auto component = [&](const char* axis) {
    const auto& names = drawn_names();
    return values.at(std::size_t(std::ranges::find(names, name + axis) - names.begin()));
  };
  return {component(".x"), component(".y"), component(".z")};
}

TEST_F(ReplayedSeries, HasModesThatAreHalfSumAndHalfDifferenceOfBothMasses) {
  replay(test::quick_campaign(1), {"a_c13"}, {"measured", "modes"});
  std::map<char, std::array<Series, 2>> mass;
  for (const char axis : {'x', 'y', 'z'}) {
    for (const int k : {1, 2}) {
      mass[axis][std::size_t(k - 1)] =
          series("a_c13/measured", "mass_" + std::to_string(k) + "_K_" + axis);
    }
  }
  const Series differential = series("a_c13/modes", "differential_x");
  ASSERT_EQ(differential.size(), 29750U);
  for (std::size_t k = 0; k < differential.size(); ++k) {
    ASSERT_EQ(differential[k], 0.5 * (mass['x'][0][k] - mass['x'][1][k]));
  }
  for (const char axis : {'x', 'y', 'z'}) {
    const Series common = series("a_c13/modes", std::string("common_") + axis);
    for (std::size_t k = 0; k < common.size(); ++k) {
      ASSERT_EQ(common[k], 0.5 * (mass[axis][0][k] + mass[axis][1][k]));
    }
  }
}

// [T] − [In] at each sample, from the file's μ/r³, û, attitude and rotation.
std::vector<Eigen::Matrix3d> gradients(const Series& gravity,
                                       const std::vector<Eigen::Vector3d>& radial_R,
                                       const std::vector<Eigen::Vector3d>& angle_RS_S,
                                       const std::vector<Eigen::Vector3d>& omega,
                                       const std::vector<Eigen::Vector3d>& omega_dot) {
  const auto skew = [](const Eigen::Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
    return m;
  };
  std::vector<Eigen::Matrix3d> all;
  for (std::size_t k = 0; k < gravity.size(); ++k) {
    const Eigen::Vector3d half = 0.5 * angle_RS_S[k];
    const Eigen::Quaterniond attitude_RS(std::sqrt(1.0 - half.squaredNorm()), half.x(), half.y(),
                                         half.z());
    const Eigen::Vector3d radial = attitude_RS.conjugate() * radial_R[k];
    all.push_back(gravity[k] * (3.0 * radial * radial.transpose() - Eigen::Matrix3d::Identity()) -
                  skew(omega[k]) * skew(omega[k]) - skew(omega_dot[k]));
  }
  return all;
}

// Γ_App,k = Γ_sat − ([T] − [In]) r_k: the difference of both masses is that of the gradients at the
// offcentring, and their mean that of the satellite, with thrust and drag, at the middle. Both are
// differences of accelerations of some 1e-7 m/s² that are rounded to 1e-23.
TEST_F(ReplayedSeries, MovesTheMassesAsTheGradientsSay) {
  const MicroscopeCampaign campaign = test::quick_campaign(1);
  const std::string session = "a_c11_delta_y";  // The satellite swings about Z.
  replay(campaign, {session}, {});
  const auto mass_1 = vectors(session + "/applied", "mass_1_S_");
  const auto mass_2 = vectors(session + "/applied", "mass_2_S_");
  const auto thrust = vectors(session + "/thrust", "acceleration_S_");
  const auto external = vectors(session + "/environment", "linear_S_");
  const std::vector<Eigen::Matrix3d> gradient = gradients(
      series(session + "/gradient", "gravity"), vectors(session + "/gradient", "radial_R_"),
      vectors(session + "/attitude", "angle_RS_S_"), vectors(session + "/attitude", "omega_IS_S_"),
      vectors(session + "/attitude", "omega_dot_IS_S_"));
  const Eigen::Vector3d offcentring = drawn_vector(campaign, "offcentring_m");
  const Eigen::Vector3d middle = drawn_vector(campaign, "centre_of_mass_offset_m");
  double largest = 0.0;
  for (std::size_t k = 0; k < gradient.size(); ++k) {
    const Eigen::Vector3d difference = gradient[k] * offcentring;
    largest = std::max(largest, difference.norm());
    ASSERT_LE((mass_1[k] - mass_2[k] - difference).norm(), 1e-21) << k;
    const Eigen::Vector3d mean = thrust[k] + external[k] - gradient[k] * middle;
    ASSERT_LE((0.5 * (mass_1[k] + mass_2[k]) - mean).norm(), 1e-21) << k;
  }
  EXPECT_GT(largest, 1e-12);  // Nine digits above the tolerance.
}

// Without noise, torques are those commanded and external, Ω is their sum, and the star tracker is
// off by a constant bias.
TEST_F(ReplayedSeries, IsDrivenByItsCommandsAlone) {
  MicroscopeCampaign campaign = test::quick_campaign(1);
  campaign.scenario.noise.scale = 0.0;
  const std::string session = "a_c11_delta_y";
  replay(campaign, {session}, {});
  const auto omega = vectors(session + "/attitude", "omega_IS_S_");
  const auto omega_dot = vectors(session + "/attitude", "omega_dot_IS_S_");
  const auto torque = vectors(session + "/attitude", "torque_command_S_");
  const auto external = vectors(session + "/environment", "angular_S_");
  const auto true_angle = vectors(session + "/attitude", "angle_RS_S_");
  const auto reported = vectors(session + "/star_tracker", "angle_RS_S_");
  const auto commanded = vectors(session + "/excitation", "attitude_S_");
  const Eigen::Vector3d bias = reported[0] - true_angle[0] - commanded[0];
  EXPECT_LE(bias.norm(), 1e-4);
  EXPECT_GT(bias.norm(), 1e-7);
  for (std::size_t k = 0; k < omega.size(); ++k) {
    ASSERT_EQ(omega_dot[k], torque[k] + external[k]) << k;
    ASSERT_LE((reported[k] - true_angle[k] - commanded[k] - bias).norm(), 1e-17) << k;
    if (k + 1 < omega.size()) {
      ASSERT_EQ(omega[k + 1], omega[k] + 1.0 * omega_dot[k]) << k;
    }
  }
}

TEST_F(ReplayedSeries, ThrustsAgainstTheCommandOfTheSampleBefore) {
  MicroscopeCampaign campaign = test::quick_campaign(1);
  campaign.scenario.noise.scale = 0.0;
  replay(campaign, {"a_d12"}, {"thrust"});
  const auto thrust = vectors("a_d12/thrust", "acceleration_S_");
  const auto command = vectors("a_d12/thrust", "command_S_");
  // [M_DF], within 5 % and 17 mrad of 1, is the same in each sample: three of them determine it.
  const auto three = [](const std::vector<Eigen::Vector3d>& v) {
    Eigen::Matrix3d m;
    m << v[100], v[1100], v[2100];
    return m;
  };
  const Eigen::Matrix3d thrust_matrix = -three(thrust) * three(command).inverse();
  EXPECT_LE((thrust_matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 0.05 + 1e-9);
  for (std::size_t k = 0; k < thrust.size(); ++k) {
    ASSERT_LE((thrust[k] + thrust_matrix * command[k]).norm(), 1e-9 * command[k].norm()) << k;
  }
}

// a sin(2πft) from the start of the session: the phase of some 1e4 rad is rounded to 1e-12 rad.
TEST_F(ReplayedSeries, IsShakenByTheSinesOfItsSessions) {
  const MicroscopeCampaign campaign = test::quick_campaign(1);
  replay(campaign, {}, {"excitation"});
  std::size_t num_excitations = 0;
  for (const Session& session : campaign.scenario.sessions) {
    for (const Excitation& excitation : session.excitations) {
      const std::string axis(1, "xyz"[index(excitation.axis)]);
      const std::map<ExcitationKind, std::string> fields{
          {ExcitationKind::attitude, "attitude_S_" + axis},
          {ExcitationKind::drag_free, "drag_free_S_" + axis},
          {ExcitationKind::test_mass, "mass_position"}};
      const std::string dataset = session.name + "/excitation";
      const Series time_s = series(dataset, "time");
      const Series value = series(dataset, fields.at(excitation.kind));
      ASSERT_EQ(value.size(), 29750U);
      for (std::size_t k = 0; k < value.size(); ++k) {
        const double phase = 2.0 * std::numbers::pi * excitation.frequency_hz * time_s[k];
        ASSERT_NEAR(value[k], excitation.amplitude * std::sin(phase), 1e-11 * excitation.amplitude)
            << session.name << " " << k;
      }
      ++num_excitations;
    }
  }
  EXPECT_EQ(num_excitations, 9U);
}

// The lines of the series, fitted step by step, are those that the run was estimated from. They
// round differently; observer_test.cpp derives the tolerance.
TEST_F(ReplayedSeries, HasTheLinesThatTheEstimateIsMadeOf) {
  const MicroscopeCampaign campaign = test::quick_campaign(1);
  const RunRecord record = RunPlan(campaign).record(RunIndex{0}, {});
  replay(campaign, {}, {"modes", "gradient"});
  const std::vector<std::tuple<SessionTarget, Signal, std::string, std::string>> cases{
      {SessionTarget::a_c11_delta_x, Signal::differential_x, "modes", "differential_x"},
      {SessionTarget::a_c11_delta_x, Signal::gradient_xx, "gradient", "estimated_S_xx"},
      {SessionTarget::a_c11_delta_z, Signal::gradient_xz, "gradient", "estimated_S_xz"},
      {SessionTarget::a_c13, Signal::differential_x, "modes", "differential_x"},
      {SessionTarget::a_d12, Signal::common_y, "modes", "common_y"},
      {SessionTarget::k2d, Signal::differential_x, "modes", "differential_x"}};
  for (const auto& [target, signal, group, field] : cases) {
    const Session& session = campaign.scenario.sessions[index(target)];
    const Series values = series(session.name + "/" + group, field);
    const auto [least, most] = std::ranges::minmax(values);
    const auto lines = test::fitted_lines(values, campaign.scenario, session);
    const auto& amplitudes = record.phasors[index(target)].amplitude[index(signal)];
    for (std::size_t i = 0; i < session.fit_lines.size(); ++i) {
      EXPECT_LE(std::abs(amplitudes[i] - lines[i]), 1e-9 * (most - least))
          << session.name << " " << field << " " << i;
      EXPECT_GT(std::abs(lines[i]), 1e-7 * (most - least)) << session.name << " " << field;
    }
  }
}

/// A campaign whose instruments have no error: the sensors differ by their noise alone.
MicroscopeCampaign perfect_campaign() {
  MicroscopeCampaign campaign = test::campaign_of(1);
  for (Dispersion& dispersion : campaign.dispersions) {
    dispersion = {};
    dispersion.law = Law::fixed;
  }
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 6;
  campaign.validate();
  return campaign;
}

// The half difference of two independent noises has half the density of one. AveragedSpectrum
// derives the five standard errors that are allowed.
TEST_F(ReplayedSeries, HasTheSpectrumOfTheSensorsNoise) {
  const MicroscopeCampaign campaign = perfect_campaign();
  const double period_s = campaign.scenario.simulation.sample_period_s;
  const std::vector<std::string> sessions{"a_c11_delta_x", "a_c11_delta_z", "a_c11_delta_y",
                                          "a_d11_prime",   "a_d12",         "a_d13"};
  replay(campaign, sessions, {"modes"});
  constexpr std::size_t segment_length = 1 << 17;  // Nine hours of the 9.9 of six orbits.
  test::AveragedSpectrum spectrum(segment_length, period_s);
  for (const std::string& session : sessions) {
    Series differential = series(session + "/modes", "differential_x");
    ASSERT_EQ(differential.size(), 142'800U);
    differential.resize(segment_length);
    spectrum.add(differential);
  }
  const NoiseShape shape = shape_noise(campaign.scenario.noise.linear_x, period_s);
  spectrum.expect([&](double f) { return 0.5 * shape.psd(f, period_s); }, 2.0, 0.0,
                  "differential_x");
}

}  // namespace
}  // namespace proofmass::coordinator
