#include "core/microscope/campaign/scenario.hpp"

#include <type_traits>

#include "core/error.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

std::string refusal_after(const std::function<void(Scenario&)>& change) {
  Scenario scenario;
  change(scenario);
  return test::message_of<ConfigError>([&] { scenario.validate(); });
}

TEST(Scenario, IsValidWithEveryPreset) {
  EXPECT_EQ(refusal_after([](Scenario&) {}), "");
  for (const NoisePreset preset :
       {NoisePreset::flight_suref, NoisePreset::wire_suref, NoisePreset::wire_suep}) {
    EXPECT_EQ(refusal_after([=](Scenario& s) { s.noise = noise_preset(preset); }), "");
  }
}

TEST(Scenario, RefusesAWireThatNoFilterFollows) {
  const auto with_damping = [](double damping_n_m) {
    return refusal_after([=](Scenario& s) {
      s.noise = noise_preset(NoisePreset::wire_suep);
      s.noise.wire.damping_n_m = damping_n_m;
    });
  };
  EXPECT_EQ(with_damping(0.035), "");
  EXPECT_EQ(with_damping(0.05),
            "noise.wire.damping_n_m = 0.05 (must leave the 1/f noise of sensor 2 along x below the "
            "white level from 50 Hz on, not 70.5 Hz)");
}

TEST(Scenario, RefusesStiffnessWhereMassesMoveTwice) {
  const auto with_stiffness = [](std::array<double, 2> stiffness_s2) {
    return refusal_after([=](Scenario& s) {
      s.estimation.method = EstimationMethod{2};
      s.sensor.radial_stiffness_s2 = stiffness_s2;
      s.sessions[4].excitations.push_back({ExcitationKind::test_mass, Axis::y, 1e-5, 7e-3});
    });
  };
  EXPECT_EQ(with_stiffness({}), "");
  EXPECT_EQ(with_stiffness({0.0, -0.3}),
            "sensor.sensor_2_radial_stiffness_s2 = -0.3 (must be 0 where two excitations of a "
            "session, session[4], move test masses)");
}

TEST(Scenario, HasTheObjectivesOfThePaper) {
  // [Hardy2013] tab:perfo-numerical, second column.
  const ParameterArray objectives{1e-7, 1e-7, 2e-6, 9e-4, 9e-4, 1.5e-4, 5e-5, 5e-5, 250, 1000};
  const Scenario scenario;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_DOUBLE_EQ(scenario.objectives[i], objectives[i]) << test::parameter_infos()[i].name;
  }
}

TEST(Scenario, ListsEachFieldOnceUnderAPathAndAComment) {
  const Scenario scenario;
  std::set<std::string> paths;
  for_each_field(scenario, [&](const FieldInfo& field, const auto&) {
    EXPECT_TRUE(paths.insert(std::string(field.path)).second) << field.path;
    EXPECT_NE(field.path.find('.'), std::string_view::npos) << field.path;
    EXPECT_FALSE(field.comment.empty()) << field.path;
  });
}

// Each field's rule is enforced, and the message names that field.
TEST(Scenario, RefusesEveryFieldThatIsNotFiniteOrNoEnumerator) {
  const auto refuses_field = [](std::size_t position) {
    Scenario scenario;
    std::string path;
    std::size_t i = 0;
    for_each_field(scenario, [&](const FieldInfo& field, auto& value) {
      if (i++ != position) return;
      path = field.path;
      using Value = std::remove_reference_t<decltype(value)>;
      if constexpr (std::is_same_v<Value, double>)
        value = std::numeric_limits<double>::infinity();
      else
        value = static_cast<Value>(std::is_enum_v<Value> ? 99 : -1);
    });
    if (path.empty()) return false;
    try {
      scenario.validate();
      ADD_FAILURE() << path << " is accepted";
    } catch (const ConfigError& error) {
      EXPECT_EQ(error.field(), path);
    }
    return true;
  };
  std::size_t position = 0;
  while (refuses_field(position)) ++position;
  EXPECT_GT(position, 80u);
}

TEST(Scenario, WantsLoopsMuchSlowerThanTheSampleRate) {
  EXPECT_EQ(refusal_after([](Scenario& s) {
              s.simulation.sample_period_s = 0.5;
              s.drag_free.bandwidth_hz = 0.11;
            }),
            "drag_free.bandwidth_hz = 0.11 (must be <= 0.1, a twentieth of the sample rate)");
  EXPECT_EQ(refusal_after([](Scenario& s) {
              s.simulation.sample_period_s = 1.0;
              s.attitude.bandwidth_hz = 0.06;
            }),
            "attitude.bandwidth_hz = 0.06 (must be <= 0.05, a twentieth of the sample rate)");
}

TEST(Scenario, WantsResonatorsSlowerThanTheLoop) {
  const auto with_resonator = [](Scenario& s) {
    Session& test = s.sessions.emplace_back();
    test.name = "v3";
    test.target = SessionTarget::ep_test;
    test.spin_rate_rad_s = 0.0184923886;  // f_EP = 3.111 mHz.
    s.drag_free.resonator_damping = 0.9;
    s.drag_free.integral_hz = 1e-3;
    s.drag_free.bandwidth_hz = 6.3e-3;
  };
  Scenario scenario;
  with_resonator(scenario);
  EXPECT_NO_THROW(scenario.validate());
  EXPECT_EQ(refusal_after([&](Scenario& s) {
              with_resonator(s);
              s.drag_free.bandwidth_hz = 6.2e-3;
            }),
            "drag_free.resonator_damping = 0.9 (must be 0 where f_EP of a session, here 0.003111 "
            "Hz of v3, is above half of drag_free.bandwidth_hz)");
  // That bandwidth is of no loop if all axes have controllers of their own.
  with_resonator(scenario = {});
  scenario.drag_free.bandwidth_hz = 6.2e-3;
  for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
    scenario.controllers.push_back({.loop = ControlLoop::drag_free,
                                    .axis = axis,
                                    .gain = 0.3,
                                    .zeros_rad_s = {},
                                    .poles_rad_s = {0.0}});
  }
  EXPECT_NO_THROW(scenario.validate());
}

TEST(Scenario, WantsIntegralsSlowerThanTheirLoops) {
  EXPECT_EQ(refusal_after([](Scenario& s) { s.drag_free.integral_hz = 0.05; }),
            "drag_free.integral_hz = 0.05 (must be < drag_free.bandwidth_hz, 0.05)");
  EXPECT_EQ(refusal_after([](Scenario& s) {
              s.attitude.bandwidth_hz = 2e-3;
              s.attitude.integral_hz = 3e-3;
            }),
            "attitude.integral_hz = 0.003 (must be < attitude.bandwidth_hz, 0.002)");
}

TEST(Scenario, WantsANoiseThatAFilterOfFiniteNumbersCanYield) {
  const auto with_x = [](const SensorNoise& noise) {
    return refusal_after([&](Scenario& s) { s.noise.linear_x = noise; });
  };
  EXPECT_EQ(with_x({.white_asd = 1e-101}),
            "noise.linear_x.white_asd_m_s2 = 1e-101 (must be in [1e-100, 1e+100])");
  EXPECT_EQ(with_x({.white_asd = 1e101}),
            "noise.linear_x.white_asd_m_s2 = 1e+101 (must be in [1e-100, 1e+100])");
  EXPECT_EQ(with_x({.white_asd = 1e-12, .rise_asd = 2.0}),
            "noise.linear_x.rise_asd_m_s2 = 2 (must be 0 or in [1e-12, 1e+12] times the white "
            "level, 1e-12)");
  EXPECT_EQ(with_x({.white_asd = 1e-12, .rise_asd = 1e-25}),
            "noise.linear_x.rise_asd_m_s2 = 1e-25 (must be 0 or in [1e-12, 1e+12] times the white "
            "level, 1e-12)");
  EXPECT_EQ(with_x({.white_asd = 1e-12, .rise_asd = 1e-12, .rise_limit_hz = 9e-7}),
            "noise.linear_x.rise_limit_hz = 9e-07 (must be 0 or in [1e-06, 0.6])");
  EXPECT_EQ(refusal_after([](Scenario& s) { s.noise.linear_yz.white_asd = 1e101; }),
            "noise.linear_yz.white_asd_m_s2 = 1e+101 (must be in [1e-100, 1e+100])");
  EXPECT_EQ(refusal_after([](Scenario& s) { s.noise.angular.white_asd = 1e101; }),
            "noise.angular.white_asd_rad_s2 = 1e+101 (must be in [1e-100, 1e+100])");
}

TEST(Scenario, WantsBandsBelowTheNyquistFrequency) {
  EXPECT_EQ(refusal_after([](Scenario& s) {
              s.sessions[9].excitations[0].frequency_hz = 0.4;
              s.sessions[9].fit_lines = {{0, 2}};
            }),
            "estimation.band_ratio = 3 (the band about line [0, 2] of session[9], 0.8 Hz, must end "
            "below the Nyquist frequency, 2 Hz)");
}

// 2 f_orb is 3.361344...e-4 Hz, and ten orbits tell lines apart that are 1.7e-5 Hz from each other.
TEST(Scenario, WantsLinesOfAMethodThatTheRecordCanTellApart) {
  const auto pushed_at = [](double frequency_hz) {
    return refusal_after([=](Scenario& s) {
      s.estimation.method = EstimationMethod{2};
      s.sessions[6].excitations[0].frequency_hz = frequency_hz;
      s.sessions[6].known_lines.clear();
    });
  };
  EXPECT_EQ(pushed_at(3.6e-4), "");
  EXPECT_EQ(
      pushed_at(3.5e-4),
      "session[6].excitations = a line at 0.00035 Hz (the estimation must tell it from a line at "
      "0.000336134 Hz with orbits = 10, and from the Nyquist frequency, 2 Hz)");
}

TEST(NoisePresets, AreThoseOfTheDesignAndOfTheFlight) {
  const NoiseConfig design = noise_preset(NoisePreset::design_2013);
  EXPECT_EQ(design.linear_x.white_asd, 1.4e-12);
  EXPECT_EQ(design.linear_yz.white_asd, 5 * 1.4e-12);
  EXPECT_EQ(design.linear_yz.rise_asd, design.linear_x.rise_asd);
  EXPECT_EQ(design.angular.rise_asd, 0.0);
  const NoiseConfig flight = noise_preset(NoisePreset::flight_suref);
  EXPECT_EQ(flight.preset, NoisePreset::flight_suref);
  EXPECT_EQ(flight.linear_x.rise_limit_hz, 0.0596);
  EXPECT_DOUBLE_EQ(flight.linear_yz.white_asd, 5 * flight.linear_x.white_asd);
  EXPECT_EQ(flight.scale, 1.0);
}

TEST(EnvironmentConfig, WritesSinesAsCosines) {
  const EnvironmentConfig environment;
  EXPECT_EQ(environment.linear_z.orbital, 1e-8);
  EXPECT_EQ(environment.linear_z.orbital_phase_rad, -std::numbers::pi / 2);
  EXPECT_EQ(environment.linear_x.twice_orbital_phase_rad, 0.3);
  EXPECT_EQ(environment.angular_y.orbital, 1e-8);
}

}  // namespace
}  // namespace proofmass
