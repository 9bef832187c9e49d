#include "core/microscope/session/session.hpp"

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Sessions = std::vector<Session>;

constexpr double orbit_period_s = 5950.0;
constexpr double sample_period_s = 0.25;
constexpr std::size_t at_delta_y = 2, at_a_c12 = 3, at_k2_sensor_1 = 9;

std::string refusal_after(const std::function<void(Sessions&)>& change) {
  Sessions sessions = hardy2013_sessions();
  change(sessions);
  return test::message_of<ConfigError>(
      [&] { validate_sessions(sessions, orbit_period_s, sample_period_s); });
}

const Session& session_with(const Sessions& sessions, SessionTarget target) {
  return *std::ranges::find(sessions, target, &Session::target);
}

TEST(Hardy2013Sessions, AreValidAndLast140Orbits) {
  EXPECT_EQ(refusal_after([](Sessions&) {}), "");
  int num_orbits = 0;
  for (const Session& session : hardy2013_sessions()) num_orbits += session.num_orbits;
  EXPECT_EQ(num_orbits, 140);
}

TEST(Hardy2013Sessions, ShakeAndLockAsThePaperSays) {
  const Sessions sessions = hardy2013_sessions();
  ASSERT_EQ(sessions.size(), 11u);
  const Session& k2_sensor_1 = session_with(sessions, SessionTarget::k2_sensor_1);
  EXPECT_EQ(k2_sensor_1.drag_free, DragFreeSource::sensor_2);
  EXPECT_EQ(k2_sensor_1.excitations[0].motion, MassMotion::mass_1);
  const Session& k2_sensor_2 = session_with(sessions, SessionTarget::k2_sensor_2);
  EXPECT_EQ(k2_sensor_2.drag_free, DragFreeSource::sensor_1);
  EXPECT_EQ(k2_sensor_2.excitations[0].motion, MassMotion::mass_2);
  EXPECT_EQ(session_with(sessions, SessionTarget::a_c12).num_orbits, 40);
  EXPECT_TRUE(session_with(sessions, SessionTarget::a_c11_delta_x).excitations.empty());
}

Session session_that_tests() {
  Session session;
  session.name = "ep";
  session.target = SessionTarget::ep_test;
  return session;
}

TEST(ValidateSessions, TakesTestsInAnyPointingWithoutLines) {
  const double f_orb_rad_s = 2.0 * std::numbers::pi / orbit_period_s;
  for (const double turns : {0.0, 4.5, -17.5}) {
    EXPECT_EQ(refusal_after([&](Sessions& sessions) {
                sessions.push_back(session_that_tests());
                sessions.back().spin_rate_rad_s = turns * f_orb_rad_s;
                sessions.back().drag_free = DragFreeSource::sensor_2;
              }),
              "");
  }
}

TEST(ValidateSessions, RefusesLinesAndExcitationsOfTests) {
  const auto refusal = [](const auto& change) {
    return refusal_after([&](Sessions& sessions) {
      sessions.push_back(session_that_tests());
      change(sessions.back());
    });
  };
  EXPECT_EQ(refusal([](Session& s) {
              s.fit_lines = {{1, 0}};
            }),
            "session[11].fit_lines = 1 lines (target ep_test has lines of its own, f_EP and "
            "2 f_EP: leave this out)");
  EXPECT_THAT(refusal([](Session& s) { s.known_lines = {{1, 0}}; }), HasSubstr("known_lines"));
  EXPECT_EQ(refusal([](Session& s) { s.num_orbits = 1001; }),
            "session[11].orbits = 1001 (must be at most 1000 with the target ep_test)");
  EXPECT_THAT(refusal([](Session& s) { s.excitations = hardy2013_sessions()[2].excitations; }),
              HasSubstr("target ep_test needs none"));
  // The frame turns with the Earth's direction.
  EXPECT_THAT(
      refusal([](Session& s) { s.spin_rate_rad_s = -2.0 * std::numbers::pi / orbit_period_s; }),
      HasSubstr("must leave f_EP = |f_orb + f_spin| at 1/(10 orbits) or more"));
}

TEST(LineFrequency, AddsMultiplesOfOrbitAndExcitation) {
  const Sessions sessions = hardy2013_sessions();
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[0], {2, 0}, orbit_period_s), 2.0 / 5950.0);
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[at_a_c12], {-2, 1}, orbit_period_s),
                   9.88e-3 - 2.0 / 5950.0);
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[8], {0, 2}, orbit_period_s), 2 * 1.22847554e-3);
}

TEST(LineFrequency, TakesPartsOfTheOrbitAndMultiplesOfTheSpin) {
  Sessions sessions = hardy2013_sessions();
  sessions[0].spin_rate_rad_s = 2.0 * std::numbers::pi * 4.5 / orbit_period_s;
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[0], {5.5, 0}, orbit_period_s), 5.5 / 5950.0);
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[0], {1, 0, 1}, orbit_period_s), 5.5 / 5950.0);
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[0], {-1, 0, 1}, orbit_period_s), 3.5 / 5950.0);
}

// The lines of a session that spins hold for the spin the other way round, too.
TEST(LineFrequency, IsNotNegative) {
  Sessions sessions = hardy2013_sessions();
  sessions[0].fit_lines = {{2, 0, 2}};
  sessions[0].known_lines = {{1, 0}, {1, 0, 1}, {1, 0, 2}, {3, 0, 2}};
  for (const double turns : {4.5, -4.5}) {
    sessions[0].spin_rate_rad_s = 2.0 * std::numbers::pi * turns / orbit_period_s;
    EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[0], {2, 0, 2}, orbit_period_s),
                     (turns > 0.0 ? 11.0 : 7.0) / 5950.0);
    EXPECT_NO_THROW(validate_sessions(sessions, orbit_period_s, 0.25));
  }
}

TEST(TestFrequency, IsThatOfTheEarthsDirectionInTheFrame) {
  Session session;
  EXPECT_DOUBLE_EQ(test_frequency_hz(session, orbit_period_s), 1.0 / 5950.0);
  session.spin_rate_rad_s = 2.0 * std::numbers::pi * 4.5 / orbit_period_s;
  EXPECT_DOUBLE_EQ(test_frequency_hz(session, orbit_period_s), 5.5 / 5950.0);
  session.spin_rate_rad_s = -session.spin_rate_rad_s;
  EXPECT_DOUBLE_EQ(test_frequency_hz(session, orbit_period_s), 3.5 / 5950.0);
}

TEST(ValidateSessions, RefusesABadName) {
  const std::string rule = " (must be 1 to 64 letters, digits or _)";
  EXPECT_EQ(refusal_after([](Sessions& s) { s[1].name = "a b"; }),
            "session[1].name = \"a b\"" + rule);
  EXPECT_EQ(refusal_after([](Sessions& s) { s[1].name = ""; }), "session[1].name = \"\"" + rule);
  const std::string too_long(65, 'a');
  EXPECT_EQ(refusal_after([&](Sessions& s) { s[1].name = too_long; }),
            "session[1].name = \"" + too_long + "\"" + rule);
  EXPECT_EQ(refusal_after([](Sessions& s) { s[1].name = s[0].name; }),
            "session[1].name = \"a_c11_delta_x\" (is the name of session[0] already)");
}

TEST(ValidateSessions, RefusesAnUnknownTarget) {
  EXPECT_EQ(refusal_after([](Sessions& s) { s[1].target = static_cast<SessionTarget>(99); }),
            "session[1].target = 99 (unknown target)");
  EXPECT_EQ(refusal_after([](Sessions& s) { s[1].target = static_cast<SessionTarget>(0); }),
            "session[1].target = 0 (unknown target)");
}

TEST(ValidateSessions, WantsTheExcitationThatShowsTheTarget) {
  EXPECT_EQ(refusal_after([](Sessions& s) { s[at_a_c12].excitations.clear(); }),
            "session[3].excitations = 0 of them (target a_c12 needs one or more)");
  EXPECT_EQ(refusal_after([](Sessions& s) { s[0].excitations = s[at_a_c12].excitations; }),
            "session[0].excitations = 1 of them (target a_c11_delta_x needs none)");
  EXPECT_EQ(refusal_after(
                [](Sessions& s) { s[at_a_c12].excitations[0].kind = ExcitationKind::drag_free; }),
            "session[3].excitations[0].kind = drag_free (target a_c12 needs test_mass)");
  EXPECT_EQ(refusal_after([](Sessions& s) { s[at_a_c12].excitations[0].axis = Axis::z; }),
            "session[3].excitations[0].axis = z (target a_c12 needs y)");
  EXPECT_EQ(
      refusal_after([](Sessions& s) { s[at_a_c12].excitations[0].motion = MassMotion::mass_1; }),
      "session[3].excitations[0].moves = mass_1 (target a_c12 needs opposition)");
  EXPECT_EQ(
      refusal_after([](Sessions& s) { s[at_k2_sensor_1].drag_free = DragFreeSource::common; }),
      "session[9].drag_free = common (target k2_sensor_1 needs sensor_2)");
}

TEST(ValidateSessions, LetsTheLoopNullAnySensorButWhereOneMassMoves) {
  const auto refusal_of = [](DragFreeSource source) {
    return refusal_after([=](Sessions& s) {
      for (std::size_t i = 0; i < at_k2_sensor_1; ++i) s[i].drag_free = source;
    });
  };
  EXPECT_EQ(refusal_of(DragFreeSource::sensor_1), "");
  EXPECT_EQ(refusal_of(DragFreeSource::sensor_2), "");
}

TEST(ValidateSessions, WantsOneDragFreePointForADPrime) {
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s.push_back(s[5]);
              s.back().name = "again";
              s.back().drag_free = DragFreeSource::sensor_2;
            }),
            "session[11].drag_free = sensor_2 (all sessions with the target a_d11_prime need one, "
            "common)");
}

// A test corrects its own record by a_d11', so that a campaign without sessions of it goes by that.
TEST(DragFreeOfADPrime, IsThatOfItsSessionsOrElseOfTheTest) {
  Sessions sessions = hardy2013_sessions();
  Session test;
  test.target = SessionTarget::ep_test;
  test.drag_free = DragFreeSource::sensor_2;
  sessions.push_back(test);
  EXPECT_EQ(drag_free_of_a_d11_prime(sessions), DragFreeSource::common);
  sessions[5].drag_free = DragFreeSource::sensor_1;
  EXPECT_EQ(drag_free_of_a_d11_prime(sessions), DragFreeSource::sensor_1);
  sessions[5].target = SessionTarget::no_target;
  EXPECT_EQ(drag_free_of_a_d11_prime(sessions), DragFreeSource::sensor_2);
  EXPECT_EQ(drag_free_of_a_d11_prime({}), DragFreeSource::common);
}

TEST(ValidateSessions, WantsAnExcitationThatCanBeSeen) {
  const auto with_amplitude = [](double amplitude) {
    return refusal_after([=](Sessions& s) { s[at_delta_y].excitations[0].amplitude = amplitude; });
  };
  EXPECT_EQ(with_amplitude(0.0), "session[2].excitations[0].amplitude_rad = 0 (must be > 0)");
  EXPECT_EQ(with_amplitude(std::numeric_limits<double>::infinity()),
            "session[2].excitations[0].amplitude_rad = inf (must be finite)");
  EXPECT_EQ(refusal_after([](Sessions& s) { s[at_delta_y].excitations[0].frequency_hz = 1.01; }),
            "session[2].excitations[0].frequency_hz = 1.01 (must be in (0, 1])");
  EXPECT_EQ(refusal_after([](Sessions& s) { s[at_delta_y].excitations[0].frequency_hz = 0.0; }),
            "session[2].excitations[0].frequency_hz = 0 (must be in (0, 1])");
}

TEST(ValidateSessions, WantsAFewLinesInsideTheBand) {
  EXPECT_EQ(refusal_after([](Sessions& s) { s[0].fit_lines.clear(); }),
            "session[0].fit_lines = [] (must name one line or more)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].fit_lines = {{2, 0}, {5, 0}, {6, 0}};
            }),
            "session[0].fit_lines = 3 lines (must be one or two)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].known_lines.clear();
              for (int i = 3; i < 19; ++i) s[0].known_lines.push_back({static_cast<double>(i), 0});
            }),
            "session[0].known_lines = 17 lines with fit_lines (must be at most 16)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].known_lines = {{0, 1}};
            }),
            "session[0].known_lines[0] = [0, 1] (the session has no excitation to take a multiple "
            "of)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[at_a_c12].known_lines = {{0, 250}};
            }),
            "session[3].known_lines[0] = [0, 250] (is at 2.47 Hz, must be between 0 and the "
            "Nyquist frequency, 2 Hz)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].fit_lines = {{0, 0}};
            }),
            "session[0].fit_lines[0] = [0, 0] (is at 0 Hz, must be between 0 and the Nyquist "
            "frequency, 2 Hz)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].fit_lines = {{1001, 0}};
            }),
            "session[0].fit_lines[0] = [1001, 0] (must be multiples from -1000 to 1000)");
}

TEST(ValidateSessions, WantsASpinForItsMultiples) {
  EXPECT_EQ(
      refusal_after([](Sessions& s) {
        s[0].known_lines = {{1, 0, 1}};
      }),
      "session[0].known_lines[0] = [1, 0, 1] (the session has no spin to take a multiple of)");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].spin_rate_rad_s = 4.7e-3;
              s[0].known_lines = {{1, 0, 1}, {5.75, 0}};
            }),
            "");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].fit_lines = {{std::numeric_limits<double>::quiet_NaN(), 0}};
            }),
            "session[0].fit_lines[0] = [nan, 0] (must be multiples from -1000 to 1000)");
}

TEST(ValidateSessions, WantsLinesThatTheSessionCanTellApart) {
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[0].known_lines.push_back({2, 0});
            }),
            "session[0].known_lines[3] = [2, 0] (must be 1/(10 orbits) or more away from "
            "fit_lines[0])");
  // 5.95 f_orb is f_orb/20 away from 6 f_orb: 20 orbits resolve that, 19 do not.
  const auto with_neighbour = [](int num_orbits) {
    return refusal_after([=](Sessions& s) {
      s[at_delta_y].num_orbits = num_orbits;
      s[at_delta_y].known_lines = {{6, 0}};
    });
  };
  EXPECT_EQ(with_neighbour(19),
            "session[2].known_lines[0] = [6, 0] (must be 1/(19 orbits) or more away from "
            "fit_lines[0])");
  EXPECT_EQ(with_neighbour(20), "");
  EXPECT_EQ(refusal_after([](Sessions& s) {
              s[at_delta_y].excitations[0].frequency_hz = 1e-6;
              s[at_delta_y].known_lines.clear();
            }),
            "session[2].fit_lines[0] = [0, 1] (must be 1/(10 orbits) or more away from the mean)");
}

/// A session of a_d12 that pushes along X and turns about Z, too.
void shake_threefold(Sessions& s) {
  s[6].excitations.push_back({ExcitationKind::drag_free, Axis::x, 1e-8, 2.1e-3});
  s[6].excitations.push_back({ExcitationKind::attitude, Axis::z, 1e-3, 0.7e-3});
  s[6].known_lines.push_back({.further = {1.0, 0.0}});
  s[6].known_lines.push_back({.orbital = 2.0, .further = {0.0, 1.0}});
}

TEST(ValidateSessions, AcceptsFurtherExcitationsWithTheirLines) {
  EXPECT_EQ(refusal_after(shake_threefold), "");
  Sessions sessions = hardy2013_sessions();
  shake_threefold(sessions);
  const auto& lines = sessions[6].known_lines;
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[6], *(lines.end() - 2), orbit_period_s), 2.1e-3);
  EXPECT_DOUBLE_EQ(line_frequency_hz(sessions[6], lines.back(), orbit_period_s),
                   0.7e-3 + 2.0 / 5950.0);
  EXPECT_EQ(text_of(lines.back()), "[2, [0, 0, 1]]");
  EXPECT_EQ(text_of({1, 2, 3, {4}}), "[1, [2, 4], 3]");
}

TEST(ValidateSessions, RefusesFurtherExcitationsThatAreWrong) {
  const auto after = [](const std::function<void(Session&)>& change) {
    return refusal_after([&](Sessions& s) {
      shake_threefold(s);
      change(s[6]);
    });
  };
  EXPECT_EQ(after([](Session& s) { s.excitations[2].amplitude = -1.0; }),
            "session[6].excitations[2].amplitude_rad = -1 (must be > 0)");
  EXPECT_EQ(after([](Session& s) { std::swap(s.excitations[0], s.excitations[1]); }),
            "session[6].excitations[0].axis = x (target a_d12 needs y)");
  EXPECT_EQ(after([](Session& s) { s.excitations.resize(5, s.excitations[1]); }),
            "session[6].excitations = 5 of them (must be at most 4)");
  EXPECT_EQ(after([](Session& s) { s.excitations.pop_back(); }),
            "session[6].known_lines[4] = [2, [0, 0, 1]] (the session has no excitations[2] to take "
            "a multiple of)");
  EXPECT_EQ(after([](Session& s) { s.known_lines[4].further[0] = 1001.0; }),
            "session[6].known_lines[4] = [2, [0, 1001, 1]] (must be multiples from -1000 to 1000)");
}

TEST(ValidateSessions, AcceptsMassesThatMoveAlongTwoAxesAtOnce) {
  const auto with = [](const Excitation& further, std::size_t session = at_a_c12) {
    return refusal_after([&](Sessions& s) { s[session].excitations.push_back(further); });
  };
  EXPECT_EQ(with({ExcitationKind::test_mass, Axis::z, 1e-6, 5e-3}), "");
  const std::string rule =
      "excitations[1].kind = test_mass (a second one that moves test masses needs both in "
      "opposition, along y and along z)";
  EXPECT_EQ(with({ExcitationKind::test_mass, Axis::y, 1e-6, 5e-3}), "session[3]." + rule);
  EXPECT_EQ(with({ExcitationKind::test_mass, Axis::x, 1e-6, 5e-3}), "session[3]." + rule);
  EXPECT_EQ(with({ExcitationKind::test_mass, Axis::z, 1e-6, 5e-3, MassMotion::mass_1}),
            "session[3]." + rule);
  EXPECT_EQ(with({ExcitationKind::test_mass, Axis::z, 1e-6, 5e-3}, 9), "session[9]." + rule);
  EXPECT_EQ(refusal_after([](Sessions& s) {
              const Excitation z{ExcitationKind::test_mass, Axis::z, 1e-6, 5e-3};
              s[at_a_c12].excitations.insert(s[at_a_c12].excitations.end(), {z, z});
            }),
            "session[3].excitations[2].kind = test_mass (a second one that moves test masses needs "
            "both in opposition, along y and along z)");
}

TEST(ValidateSessions, LetsASessionWithoutTargetShakeWhatItLikes) {
  const auto after = [](std::vector<Excitation> excitations) {
    return refusal_after([&](Sessions& s) {
      s[6].target = SessionTarget::no_target;
      s[6].drag_free = DragFreeSource::sensor_1;
      s[6].excitations = std::move(excitations);
      s[6].fit_lines = {{1, 0}};
      s[6].known_lines = {{2, 0}};
    });
  };
  EXPECT_EQ(after({}), "");
  EXPECT_EQ(after({{ExcitationKind::attitude, Axis::y, 1e-3, 1e-3}}), "");
  EXPECT_EQ(after({{ExcitationKind::attitude, Axis::y, -1e-3, 1e-3}}),
            "session[6].excitations[0].amplitude_rad = -0.001 (must be > 0)");
}

}  // namespace
}  // namespace proofmass
