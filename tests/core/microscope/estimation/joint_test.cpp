// The model of a line against the measurement equation of two sensors, its derivatives against
// differences, and the fit on records that the model makes.

#include "core/microscope/estimation/joint/joint.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/estimation/joint/joint_model.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/simulation/session_record.hpp"
#include "core/random/stream.hpp"
#include "core/signal/line_weights.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;
using Means = std::array<double, num_line_bases>;

constexpr std::size_t num_samples = 1024;
// Whole numbers of cycles in the record: what varies with the orbit, what is shaken, what moves.
constexpr double cycles_orbit = 5.0, cycles_shaken = 31.0, cycles_moved = 101.0;
constexpr double cycles_moved_again = 137.0;
// What turns, twice as fast as what moves but for a cycle of the orbit.
constexpr double cycles_turned = 2.0 * cycles_moved - cycles_orbit;
constexpr double duration_s = 14'875.0;  // In which 2 f_orb has cycles_orbit.
constexpr double turned_rad_s = 2.0 * std::numbers::pi * cycles_turned / duration_s;
constexpr double moved_rad_s = 2.0 * std::numbers::pi * cycles_moved / duration_s;

double turn(double cycles, std::size_t k) {
  return 2.0 * std::numbers::pi * cycles * static_cast<double>(k) / num_samples;
}

/// Amplitudes of cosine and sine of a signal at a line; lines are orthogonal over the record.
Complex line_of(const std::vector<double>& signal, double cycles) {
  Complex sum;
  for (std::size_t k = 0; k < num_samples; ++k) {
    sum += signal[k] * Complex(std::cos(turn(cycles, k)), std::sin(turn(cycles, k)));
  }
  return sum * (2.0 / num_samples);
}

double mean_of(const std::vector<double>& signal) {
  double sum = 0.0;
  for (const double value : signal) sum += value;
  return sum / num_samples;
}

Instrument drawn_instrument(std::uint64_t run) {
  return make_instrument(draw_values(nominal_dispersions(), 7, RunIndex{run}, 0, {}));
}

/// What two sensors measure of a motion that is the same in every record, sample by sample as
/// [Hardy2013] eq:measurement has it.
class Record {
 public:
  /// @param turn_rad  Amplitude of the satellite's rotation about Y and Z.
  Record(const Instrument& instrument, const Session& session, double turn_rad = 0.0)
      : instrument_(instrument), session_(session), turn_rad_(turn_rad) {
    // The loop holds the mean of its input at the read-out bias.
    for (int i = 0; i < 5; ++i) {
      measure();
      held_ -= mean_input();
    }
    measure();
  }

  [[nodiscard]] Means means() const {
    Means means{};
    for (std::size_t s = 0; s < num_line_bases; ++s) means[s] = mean_of(bases_[s]);
    return means;
  }
  [[nodiscard]] LinePhasors line(LineSignals signals, double cycles) const {
    LinePhasors line{};
    for (std::size_t s = 0; s < num_line_bases; ++s) line[s] = line_of(bases_[s], cycles);
    const auto& further = signals == LineSignals::squares       ? squares_
                          : signals == LineSignals::moved       ? moved_[0]
                          : signals == LineSignals::moved_again ? moved_[1]
                                                                : further_rows_;
    for (std::size_t s = 0; s < further.size(); ++s) {
      line[num_line_bases + s] = line_of(further[s], cycles);
    }
    return line;
  }

 private:
  using Signals = std::vector<std::vector<double>>;

  /// Of [T] − [In], with the part of Ω̇ in [In].
  [[nodiscard]] Eigen::Matrix3d gradient_at(std::size_t k) const {
    const double rate_rad_s2 =
        -turn_rad_ * turned_rad_s * turned_rad_s * std::sin(turn(cycles_turned, k));
    Eigen::Matrix3d constant, varying, turning;
    turning << 0.0, -1.0, 1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0;
    constant << 5.6e-7, 1e-9, 2e-9, 1e-9, -1.1e-6, 0.0, 2e-9, 0.0, 5.6e-7;
    varying << 1.0, 0.3, 0.8, 0.3, 0.4, 0.2, 0.8, 0.2, -1.0;
    return constant + 1.67e-6 * varying * std::cos(turn(cycles_orbit, k)) - rate_rad_s2 * turning;
  }

  /// Γ_App,k + p_k in S.
  [[nodiscard]] Eigen::Vector3d kinematic(std::size_t mass, const Eigen::Matrix3d& gradient,
                                          std::size_t k) const {
    const double side = mass == 0 ? -0.5 : 0.5;
    Eigen::Vector3d r = side * instrument_.offcentring_S_m;
    Eigen::Vector3d a = held_;
    const double omega_rad_s = turn_rad_ * turned_rad_s * std::cos(turn(cycles_turned, k));
    const Eigen::Vector3d omega(0.0, omega_rad_s, omega_rad_s);
    for (const Excitation& e : session_.excitations) {
      const auto axis = static_cast<Eigen::Index>(index(e.axis));
      if (e.kind == ExcitationKind::drag_free) {
        a[axis] += e.amplitude * std::sin(turn(cycles_shaken, k));
      } else {
        const Eigen::Vector3d direction =
            side * instrument_.sensors[mass].alignment_KS().transpose().col(axis);
        const double speed_m_s = e.amplitude * moved_rad_s * std::cos(turn(cycles_moved, k));
        r += position(&e == mass_excitations(session_)[1] ? 1 : 0, k) * direction;
        a += 2.0 * speed_m_s * omega.cross(direction);
      }
    }
    return a - gradient * r;
  }

  /// Δ_TM sin of a motion; 0 of one that the session has not.
  [[nodiscard]] double position(std::size_t motion, std::size_t k) const {
    const Excitation* const moving = mass_excitations(session_)[motion];
    if (moving == nullptr) return 0.0;
    return moving->amplitude * std::sin(turn(motion == 0 ? cycles_moved : cycles_moved_again, k));
  }

  void measure() {
    bases_.assign(num_line_bases, {});
    squares_.assign(2, {});
    further_rows_.assign(6, {});
    for (Signals& moved : moved_) moved.assign(9, {});
    for (std::size_t k = 0; k < num_samples; ++k) {
      const Eigen::Matrix3d gradient = gradient_at(k);
      std::array<Eigen::Vector3d, 2> measured;
      for (std::size_t mass = 0; mass < 2; ++mass) {
        const Sensor& sensor = instrument_.sensors[mass];
        const Eigen::Vector3d a = kinematic(mass, gradient, k), p = sensor.parasitic_K_m_s2;
        measured[mass] = sensor.read_out_bias_K_m_s2 + sensor.sensitivity_KS() * a -
                         sensor.symmetric_part() * p +
                         sensor.quadratic_s2_m.cwiseProduct((a - p).cwiseAbs2());
        squares_[mass].push_back(measured[mass].x() * measured[mass].x());
      }
      bases_[0].push_back(0.5 * (measured[0].x() - measured[1].x()));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<Eigen::Index>(axis);
        bases_[1 + axis].push_back(0.5 * (measured[0][i] + measured[1][i]));
      }
      for (std::size_t i = 0; i < 9; ++i) {
        const double g =
            gradient(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3));
        (i < 3 ? bases_[4 + i] : further_rows_[i - 3]).push_back(g);
        for (std::size_t j = 0; j < 2; ++j) moved_[j][i].push_back(0.5 * position(j, k) * g);
      }
    }
  }

  /// Mean of the loop's input less its read-out bias.
  [[nodiscard]] Eigen::Vector3d mean_input() const {
    Eigen::Vector3d input;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      input[axis] = mean_of(bases_[1 + static_cast<std::size_t>(axis)]) -
                    0.5 * (instrument_.sensors[0].read_out_bias_K_m_s2[axis] +
                           instrument_.sensors[1].read_out_bias_K_m_s2[axis]);
    }
    if (session_.drag_free == DragFreeSource::common) return input;
    const double sign = session_.drag_free == DragFreeSource::sensor_1 ? 1.0 : -1.0;
    input.x() +=
        sign * (mean_of(bases_[0]) - 0.5 * (instrument_.sensors[0].read_out_bias_K_m_s2.x() -
                                            instrument_.sensors[1].read_out_bias_K_m_s2.x()));
    return input;
  }

  const Instrument& instrument_;
  const Session& session_;
  double turn_rad_;
  Eigen::Vector3d held_ = Eigen::Vector3d::Zero();
  Signals bases_, squares_, further_rows_;
  std::array<Signals, 2> moved_;
};

Session session_with(std::vector<Excitation> excitations,
                     DragFreeSource source = DragFreeSource::common) {
  Session session;
  session.drag_free = source;
  session.excitations = std::move(excitations);
  return session;
}

constexpr Excitation push_along(Axis axis) {
  return {ExcitationKind::drag_free, axis, 2e-8, 1e-3, MassMotion::opposition};
}
constexpr Excitation move_along(Axis axis) {
  return {ExcitationKind::test_mass, axis, 1e-5, 1e-2, MassMotion::opposition};
}

/// Largest |model − Γ_mes,dx| at a line over some instruments, m/s².
double largest_misfit(const Session& session, LineSignals signals, double cycles) {
  double largest = 0.0;
  for (std::uint64_t run = 0; run < 3; ++run) {
    const Instrument instrument = drawn_instrument(run);
    const Record record(instrument, session);
    LinePhasors line = record.line(signals, cycles);
    if (signals == LineSignals::squares) line = centred(line, record.means());
    const LineCoefficients model =
        line_coefficients(session, record.means(), true_unknowns(instrument, 0.0));
    largest = std::max(largest, std::abs(predict(model, signals, line).value - line[0]));
  }
  return largest;
}

// What the model leaves out is of third order: 1e-8 of the 2e-8 m/s² that a session commands, and
// 3e-5 (a_c1j² and tilts of second order) of the gradients' 3e-11 m/s². The noise of a line is
// 1e-14 m/s². Every term of the model is a hundred times larger in some of these sessions.
TEST(JointModel, IsWhatTwoSensorsMeasure) {
  const double bound = 4e-16;
  EXPECT_LT(largest_misfit(session_with({}), LineSignals::gradients, cycles_orbit), bound);
  for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
    const Session session = session_with({push_along(axis)});
    EXPECT_LT(largest_misfit(session, LineSignals::gradients, cycles_shaken), bound);
    EXPECT_LT(largest_misfit(session, LineSignals::gradients, cycles_orbit), bound);
  }
  for (const DragFreeSource source :
       {DragFreeSource::common, DragFreeSource::sensor_1, DragFreeSource::sensor_2}) {
    const Session session = session_with({push_along(Axis::x)}, source);
    EXPECT_LT(largest_misfit(session, LineSignals::squares, 2.0 * cycles_shaken), bound);
  }
  for (const Axis axis : {Axis::y, Axis::z}) {
    const Session session = session_with({move_along(axis)});
    EXPECT_LT(largest_misfit(session, LineSignals::moved, cycles_moved + cycles_orbit), bound);
    EXPECT_LT(largest_misfit(session, LineSignals::moved, cycles_moved - cycles_orbit), bound);
  }
  // Both motions at once, whichever the first one is.
  for (const auto& [first, second] : {std::pair{Axis::y, Axis::z}, std::pair{Axis::z, Axis::y}}) {
    const Session session =
        session_with({push_along(Axis::x), move_along(first), move_along(second)});
    for (const double side : {-cycles_orbit, cycles_orbit}) {
      EXPECT_LT(largest_misfit(session, LineSignals::moved, cycles_moved + side), bound);
      EXPECT_LT(largest_misfit(session, LineSignals::moved_again, cycles_moved_again + side),
                bound);
    }
  }
}

/// Largest |model − Γ_mes,dx| at a line of a push along an axis, over some instruments, as a part
/// of the amplitude times (14000 s²/m of the amplitude)^4: a term of the fifth order is one of
/// these.
double fifth_order_misfit(Axis axis, double amplitude_m_s2, DragFreeSource source, PushLine at) {
  Excitation excitation = push_along(axis);
  excitation.amplitude = amplitude_m_s2;
  const Session session = session_with({excitation}, source);
  const double part = 14'000.0 * amplitude_m_s2;
  const bool is_twice = at == PushLine::at_2f;
  const LineSignals signals = is_twice ? LineSignals::squares : LineSignals::gradients;
  double largest = 0.0;
  for (std::uint64_t run = 0; run < 8; ++run) {
    const Instrument instrument = drawn_instrument(run);
    const Record record(instrument, session);
    const LinePhasors at_f = record.line(LineSignals::gradients, cycles_shaken);
    LinePhasors line = record.line(signals, (is_twice ? 2.0 : 1.0) * cycles_shaken);
    const std::size_t common = 1 + index(axis);
    const Push push{.axis = axis,
                    .at_f = at_f[common],
                    .at_2f = record.line(LineSignals::squares, 2.0 * cycles_shaken)[common]};
    if (is_twice) line = centred(line, record.means());
    const UnknownArray truth = true_unknowns(instrument, 0.0);
    const Complex value =
        predict(line_coefficients(session, record.means(), truth), signals, line).value +
        push_terms(source, truth, push, at).value;
    largest = std::max(largest, std::abs(value - line[0]) / (amplitude_m_s2 * std::pow(part, 4)));
  }
  return largest;
}

// At 3e-6 m/s² terms of the third order are 500 of the fifth order; what is left out are a few of
// those. The record has an inert loop, so that all of the square is left at 2 f.
TEST(JointModel, HasWhatTheSquaresOfAStrongPushMakeOfIt) {
  for (const DragFreeSource source :
       {DragFreeSource::common, DragFreeSource::sensor_1, DragFreeSource::sensor_2}) {
    for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
      EXPECT_LT(fifth_order_misfit(axis, 3e-6, source, PushLine::at_f), 3.0);
    }
    EXPECT_LT(fifth_order_misfit(Axis::x, 3e-6, source, PushLine::at_2f), 3.0);
  }
}

// A rotation ψ(t) displaces a mass at q along Y by −ψq along X of inertial space. Of the second
// derivative of ψq, the sensor feels ψ̈q + 2ψ̇q̇ along X. With frequencies ν and f, these two have
// the amplitudes −ν² and 2νf at ν − f, together ν(2f − ν): 5/197 of the first here.
TEST(JointModel, LeavesOutOfAMotionWhatCoriolissAccelerationCancels) {
  const double turn_rad = 1e-4;
  for (const Axis axis : {Axis::y, Axis::z}) {
    const Session session = session_with({move_along(axis)});
    const Instrument instrument = drawn_instrument(0);
    const Record record(instrument, session, turn_rad);
    const LinePhasors line = record.line(LineSignals::moved, cycles_moved - cycles_orbit);
    const LineCoefficients model =
        line_coefficients(session, record.means(), true_unknowns(instrument, 0.0));
    const double of_rotation = 0.25 * turn_rad * turned_rad_s * turned_rad_s * 1e-5;
    const double misfit = std::abs(predict(model, LineSignals::moved, line).value - line[0]);
    EXPECT_LT(misfit, 1.05 * cycles_orbit / cycles_turned * of_rotation);
    EXPECT_GT(misfit, 0.95 * cycles_orbit / cycles_turned * of_rotation);
  }
}

/// Numbers from −1 to 1.
class Random {
 public:
  double operator()() {
    return 2.0 * uniform(RandomStream(3, RunIndex{0}, stream_id("joint")).block(next_++)) - 1.0;
  }
  LinePhasors line(double further) {
    LinePhasors line;
    for (std::size_t i = 0; i < line.size(); ++i) {
      line[i] = Complex((*this)(), (*this)()) * (i < 4                ? 1e-8
                                                 : i < num_line_bases ? 1e-6
                                                                      : further);
    }
    return line;
  }

 private:
  std::uint32_t next_ = 0;
};

constexpr UnknownArray sizes{2e-5, 2e-5, 2e-5, 2e-3, 2e-3, 1e-2, 1e-3, 1e-3, 1e4,  1e4,  1e-2, 1e-4,
                             1e-4, 2e-3, 5e-5, 5e-5, 5e-5, 1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e8,  1e8};

// A central difference over ±1e-3 of each size errs by 1e-6 of the second-order terms, which are a
// hundredth of the slope, and by rounding, 1e-13 of the value over that step.
TEST(JointModel, HasTheDerivativesOfItsValue) {
  Random random;
  const Means means{1e-8, 1e-8, 0.0, 0.0, 5e-7, 1e-9, 1e-8};
  const std::vector<std::pair<LineSignals, double>> kinds{{LineSignals::gradients, 1e-6},
                                                          {LineSignals::squares, 1e-16},
                                                          {LineSignals::moved, 1e-11},
                                                          {LineSignals::moved_again, 1e-11}};
  for (const DragFreeSource source :
       {DragFreeSource::common, DragFreeSource::sensor_1, DragFreeSource::sensor_2}) {
    for (const Axis axis : {Axis::y, Axis::z}) {
      const Axis other = axis == Axis::y ? Axis::z : Axis::y;
      const Session session = session_with({move_along(axis), move_along(other)}, source);
      for (const auto& [signals, further] : kinds) {
        const LinePhasors line = random.line(further);
        UnknownArray at;
        for (std::size_t i = 0; i < num_unknowns; ++i) at[i] = sizes[i] * random();
        const auto value = [&](std::size_t i, double step) {
          UnknownArray moved = at;
          moved[i] += step;
          return predict(line_coefficients(session, means, moved), signals, line).value;
        };
        const Prediction model = predict(line_coefficients(session, means, at), signals, line);
        for (std::size_t i = 0; i < num_unknowns; ++i) {
          const double step = 1e-3 * sizes[i];
          const Complex slope = (value(i, step) - value(i, -step)) / (2.0 * step);
          const double rounding = 1e-13 * std::abs(model.value) / step;
          EXPECT_LE(std::abs(slope - model.slope[i]), 1e-6 * std::abs(slope) + rounding)
              << "unknown " << i << ", signals " << static_cast<int>(signals);
        }
      }
    }
  }
}

std::string refusal(const std::vector<Session>& sessions) {
  return test::message_of<ConfigError>([&] { check_joint(sessions); });
}

TEST(Joint, RefusesSessionsThatCannotTellEveryParameter) {
  std::vector<Session> sessions = hardy2013_sessions();
  EXPECT_EQ(refusal(sessions), "");
  sessions[2].spin_rate_rad_s = 1e-3;
  EXPECT_EQ(refusal(sessions),
            "session[2].spin_rate_rad_s = 0.001 (estimation.method = \"joint\" needs 0)");
  const auto without = [](std::initializer_list<SessionTarget> targets) {
    std::vector<Session> rest = hardy2013_sessions();
    std::erase_if(rest, [&](const Session& session) {
      return std::ranges::find(targets, session.target) != targets.end();
    });
    return refusal(rest);
  };
  using enum SessionTarget;
  EXPECT_EQ(without({a_c11_delta_x, a_c11_delta_z, k2_sensor_1}), "");
  const std::string needs = " sessions (estimation.method = \"joint\" needs one that ";
  EXPECT_EQ(without({a_d11_prime, k2d}), "session = 9" + needs + "pushes along x)");
  EXPECT_EQ(without({a_d12}), "session = 10" + needs + "pushes along y)");
  EXPECT_EQ(without({a_d13}), "session = 10" + needs + "pushes along z)");
  EXPECT_EQ(without({a_c11_delta_y}), "session = 10" + needs + "turns about z)");
  EXPECT_EQ(without({a_c12}), "session = 10" + needs + "moves masses in opposition along y)");
  EXPECT_EQ(without({a_c13}), "session = 10" + needs + "moves masses in opposition along z)");
  EXPECT_EQ(without({k2_sensor_1, k2_sensor_2}), "session = 9" + needs + "moves one mass along x)");
  EXPECT_EQ(without({a_d12, a_c13}), "session = 9" + needs +
                                         "pushes along y, one that moves masses in opposition "
                                         "along z)");
}

// The limits for the nominal law of K2, uniform within 14000 s²/m: K = 14000/√3 s²/m. Alone,
// 8.75 K⁴ Γ⁴ = 150e-6/50; beside others, 1.5 K² Γ² = 150e-6/50.
TEST(Joint, RefusesPushesOfWhichItLeavesOutTooMuch) {
  const PushLimits limits = push_limits(drawn_moments(nominal_dispersions()), 150e-6);
  const double k2_s2_m = 14'000.0 / std::sqrt(3.0);
  EXPECT_NEAR(8.75 * std::pow(k2_s2_m * limits.alone_along_x, 4), 3e-6, 1e-11);
  EXPECT_NEAR(1.5 * std::pow(k2_s2_m * limits.beside_others, 2), 3e-6, 1e-11);
  const auto refused = [&](std::vector<Excitation> excitations) {
    return test::message_of<ConfigError>(
        [&] { check_joint_pushes({session_with(std::move(excitations))}, limits); });
  };
  const auto push = [](Axis axis, double amplitude_m_s2) {
    Excitation excitation = push_along(axis);
    excitation.amplitude = amplitude_m_s2;
    return excitation;
  };
  EXPECT_EQ(refused({push(Axis::x, 2.99e-6)}), "");
  EXPECT_EQ(refused({push(Axis::x, 3.1e-6)}),
            "session[0].excitations[0].amplitude_m_s2 = 3.1e-06 (must be <= 2.99e-06 for "
            "estimation.method = \"joint\": beyond, what K2 makes of it and the model leaves out "
            "may move a_d11' by 1/50 of its objective)");
  EXPECT_EQ(refused({move_along(Axis::y), push(Axis::x, 1.7e-7)}), "");
  EXPECT_EQ(refused({push(Axis::y, 9e-6)}), "");
  EXPECT_EQ(refused({push(Axis::y, 2e-8), push(Axis::x, 1.7e-7)}), "");
  for (const Excitation& other : {push(Axis::y, 2e-8), move_along(Axis::y)}) {
    EXPECT_EQ(
        refused({other, push(Axis::x, 1.8e-7)}),
        "session[0].excitations[1].amplitude_m_s2 = 1.8e-07 (must be <= 1.7496e-07 for "
        "estimation.method = \"joint\" beside the session's other excitations: beyond, errors "
        "exceed the standard errors)");
  }
}

// An amplitude has room below the limit that a campaign file is refused above, in any session.
TEST(Joint, TellsWhichAmplitudesMayBeLarger) {
  const PushLimits limits{.alone_along_x = 3e-6, .beside_others = 1.7e-7};
  const auto shaken = [](Excitation excitation, double amplitude) {
    excitation.amplitude = amplitude;
    return excitation;
  };
  using enum Parameter;
  const auto apart = [&](double amplitude_m) {
    return session_with({shaken(move_along(Axis::y), amplitude_m)});
  };
  EXPECT_TRUE(may_be_larger({apart(1.9e-5)}, a_c12, limits));
  EXPECT_FALSE(may_be_larger({apart(2e-5)}, a_c12, limits));
  EXPECT_TRUE(may_be_larger({apart(2e-5), apart(1e-5)}, a_c12, limits));
  EXPECT_FALSE(may_be_larger({apart(1e-5)}, a_c13, limits));
  EXPECT_FALSE(may_be_larger({apart(1e-5)}, a_c11_delta_x, limits));
  const Excitation along_x = shaken(push_along(Axis::x), 2e-7);
  EXPECT_TRUE(may_be_larger({session_with({along_x})}, a_d11_prime, limits));
  EXPECT_FALSE(may_be_larger({session_with({along_x, push_along(Axis::y)})}, a_d11_prime, limits));
  EXPECT_TRUE(may_be_larger({session_with({along_x, push_along(Axis::y)})}, a_d12, limits));
}

TEST(Joint, RefusesRecordsShorterThanAnOrbit) {
  std::vector<Session> sessions = hardy2013_sessions();
  sessions[4].num_orbits = 2;
  EXPECT_EQ(test::message_of<ConfigError>([&] { check_joint_records(sessions, 5950.0, 5950.0); }),
            "");
  sessions[4].num_orbits = 1;
  EXPECT_EQ(test::message_of<ConfigError>([&] { check_joint_records(sessions, 5950.0, 0.0); }), "");
  EXPECT_EQ(test::message_of<ConfigError>([&] { check_joint_records(sessions, 5950.0, 1000.0); }),
            "session[4].orbits = 1 (estimation.method = \"joint\" needs 2 or more: less "
            "estimation.transient_s = 1000 the record of session a_c13 is 4950 s long, and must be "
            "an orbit, 5950 s)");
}

// Every session that may be asked for: its lines fit into one set of weights, with the level.
TEST(Joint, AsksForNoMoreLinesThanAFitHolds) {
  std::vector<Excitation> kinds;
  for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
    kinds.push_back({ExcitationKind::attitude, axis, 1e-3, 1e-3, MassMotion::opposition});
    kinds.push_back(push_along(axis));
    for (const MassMotion motion :
         {MassMotion::opposition, MassMotion::mass_1, MassMotion::mass_2}) {
      kinds.push_back({ExcitationKind::test_mass, axis, 1e-5, 1e-2, motion});
    }
  }
  std::size_t num_fitted_max = 0, num_wanted_max = 0;
  const std::size_t n = kinds.size();
  ASSERT_EQ(num_excitations_max, 4U);
  for (std::size_t i = 0; i < n * n * n * n; ++i) {
    const Session session = session_with(
        {kinds[i % n], kinds[i / n % n], kinds[i / (n * n) % n], kinds[i / (n * n * n)]});
    const auto is_moving = [](const Excitation& e) { return e.kind == ExcitationKind::test_mass; };
    if (std::ranges::count_if(session.excitations, is_moving) > 2) continue;
    const RecordNeeds needs = joint_needs(session);
    num_wanted_max = std::max(num_wanted_max, needs.lines.size());
    num_fitted_max = std::max(num_fitted_max, needs.lines.size() + needs.neighbours.size() + 1);
  }
  EXPECT_LE(num_wanted_max, num_line_readers_max);
  EXPECT_LE(num_fitted_max, LineWeights::num_lines_max);
  EXPECT_GT(num_fitted_max, 25U);
}

}  // namespace
}  // namespace proofmass
