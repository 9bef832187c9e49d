#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "coordinator/archive/replay.hpp"
#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/support/averaged_spectrum.hpp"
#include "tests/support/fitted_lines.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// Where read_series.py writes what is in a file.
std::filesystem::path raw_folder(const std::filesystem::path& file) {
  return file.string() + ".raw";
}

/// Values of a field of a dataset, `a_c13/measured` and `mass_1_K_x`, as h5py reads them: another
/// program than the one that writes. The first call reads all of the file.
std::vector<double> series_in(const std::filesystem::path& file, std::string dataset,
                              const std::string& field) {
  const std::filesystem::path folder = raw_folder(file);
  if (std::filesystem::create_directory(folder)) {
    const std::string command = std::string("/usr/bin/python3 '") + PROOFMASS_READ_SERIES + "' '" +
                                file.string() + "' '" + folder.string() + "'";
    EXPECT_EQ(std::system(command.c_str()), 0);
  }
  std::ranges::replace(dataset, '/', '.');
  const std::filesystem::path raw = folder / (dataset + "." + field);
  std::vector<double> values(std::filesystem::file_size(raw) / sizeof(double));
  std::ifstream(raw, std::ios::binary)
      .read(reinterpret_cast<char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(double)));
  return values;
}

// What holds of the motion that a replayed file shows: equations of [Hardy2013], closed forms of
// the excitations and the spectrum of the noise, computed from nothing but the file and the
// campaign.

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
    std::filesystem::remove_all(raw_folder(series_));
  }

  [[nodiscard]] Series series(const std::string& dataset, const std::string& field) const {
    return series_in(series_, dataset, field);
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
    std::filesystem::remove_all(raw_folder(directory() / "run.h5"));
    return series_in(directory() / "run.h5", session + "/modes", "differential_x");
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
    // From f/3 to 3 f about 2 f_orb, five orbits have 26 frequencies, of which lines leave too few.
    const bool has_few =
        spectrum.session.starts_with("a_c11_delta") && spectrum.session.back() != 'y';
    ASSERT_EQ(spectrum.noise_ratio.has_value(), !has_few) << spectrum.session;
    if (has_few) continue;
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

TEST_F(ReplayedSpectra, EndWhenAsked) {
  const Store store = store_with(test::quick_campaign(1));
  EXPECT_THROW((void)replayed_spectra(Replay(store), RunIndex{0}, test::stopped_at_once),
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
      worst_run_spectra(store, review_of_worst(RunValue{RunIndex{2}, 0.9}), test::never_stopped)
          .value();
  EXPECT_EQ(spectra.run, RunIndex{2});
  const RunSpectra own = replayed_spectra(Replay(store), RunIndex{2}, test::never_stopped);
  ASSERT_EQ(spectra.sessions.size(), 11U);
  EXPECT_EQ(spectra.sessions[4].lines[0].amplitude, own.sessions[4].lines[0].amplitude);
}

TEST_F(ReplayedSpectra, SayWhyThereAreNone) {
  { const Store store = store_with(test::quick_campaign(1)); }
  test::change(file(), "UPDATE campaign SET model_version = 'hardy2013-2'");
  const Store store = Store::open_read_only(file());
  EXPECT_THAT(worst_run_spectra(store, review_of_worst({}), test::never_stopped)->reasons,
              ElementsAre("No run has an estimate, or no quantity an objective."));
  EXPECT_THAT(
      worst_run_spectra(store, review_of_worst(RunValue{RunIndex{0}, 0.9}), test::never_stopped)
          ->reasons,
      ElementsAre("Run 0 cannot be replayed: model_version = hardy2013-2 (must be "
                  "hardy2013-15, the model of this program: others compute other bits)."));
}

TEST_F(ReplayedSpectra, NameTheirCharts) {
  const Store store = store_with(test::quick_campaign(1));
  const std::vector<std::string> names = spectrum_names(Replay(store).recording());
  ASSERT_EQ(names.size(), 11U);
  EXPECT_EQ(names[4], "spectrum:a_c13");
}

}  // namespace
}  // namespace proofmass::coordinator
