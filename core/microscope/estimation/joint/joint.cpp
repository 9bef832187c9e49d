#include "core/microscope/estimation/joint/joint.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/control/star_tracker.hpp"
#include "core/microscope/estimation/joint/joint_model.hpp"

namespace proofmass {
namespace {

constexpr auto num_rows = static_cast<Eigen::Index>(num_unknowns);
using NormalMatrix = Eigen::Matrix<double, num_rows, num_rows>;
using NormalVector = Eigen::Matrix<double, num_rows, 1>;

// Priors.

/// Mean and standard deviation of what is known of a number beforehand.
struct Prior {
  double mean = 0.0;
  double deviation = 0.0;
};

/// Of one drawn quantity. Its bound is the nominal one: that of a table's column, whose values the
/// method does not see, and the unit of the least deviation that a prior has.
Prior prior_of(const DispersionSet& dispersions, std::size_t quantity, double bound) {
  const Dispersion& dispersion = dispersions[quantity];
  Prior prior{.mean = 0.0, .deviation = bound / std::sqrt(3.0)};
  const double middle = 0.5 * (dispersion.minimum + dispersion.maximum);
  const double flat = (dispersion.maximum - dispersion.minimum) / std::sqrt(12.0);
  switch (dispersion.law) {
    case Law::uniform:
      prior = {middle, flat};
      break;
    case Law::normal:
    case Law::correlated:
      prior = {dispersion.mean, dispersion.standard_deviation};
      break;
    case Law::truncated_normal:
      prior = {std::clamp(dispersion.mean, dispersion.minimum, dispersion.maximum),
               std::min(dispersion.standard_deviation, flat)};
      break;
    case Law::fixed:
      prior = {dispersion.value, 0.0};
      break;
    case Law::discrete:
    case Law::truncated:
    case Law::derived: {
      const LawMoments moments = sampled_moments(dispersions, quantity);
      prior = {moments.mean, moments.standard_deviation};
      break;
    }
    case Law::table:
      break;
  }
  prior.deviation = std::max(prior.deviation, 1e-6 * bound);
  return prior;
}

double root_of_squares(double a, double b) { return std::sqrt(a * a + b * b); }

/// Priors of linear combinations of a group's elements.
class GroupPriors {
 public:
  GroupPriors(const DispersionSet& dispersions, std::string_view name) {
    const auto group = std::ranges::find(draw_groups(), name, &DrawGroup::name);
    PROOFMASS_EXPECT(group != draw_groups().end());
    for (std::size_t i = 0; i < group->count; ++i) {
      elements_[i] = prior_of(dispersions, group->first + i, group->bound);
    }
  }

  /// Of first·(the axis of sensor 1) + second·(that of sensor 2).
  [[nodiscard]] Prior combined(Axis axis, double first, double second) const {
    const Prior& one = elements_[index(axis)];
    const Prior& two = elements_[3 + index(axis)];
    return {first * one.mean + second * two.mean,
            root_of_squares(first * one.deviation, second * two.deviation)};
  }
  [[nodiscard]] const Prior& operator[](std::size_t i) const { return elements_[i]; }

 private:
  std::array<Prior, 6> elements_{};
};

using Priors = std::array<Prior, num_unknowns>;

/// Bias of the fused angles about an axis, from those of the heads.
Prior fused_bias(const GroupPriors& heads, const StarTracker& tracker, std::size_t axis) {
  Prior fused;
  double variance = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const double weight =
        tracker.weight[i / 3](static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(i % 3));
    fused.mean += weight * heads[i].mean;
    variance += weight * weight * heads[i].deviation * heads[i].deviation;
  }
  fused.deviation = std::sqrt(variance);
  return fused;
}

/// The parameters have none; in their places is the unit that they are solved in, the objective.
Priors make_priors(const EstimationInput& input) {
  const auto of_group = [&](std::string_view name) { return GroupPriors(input.dispersions, name); };
  const GroupPriors scale = of_group("scale_factor_error"), coupling = of_group("coupling_rad"),
                    angle = of_group("misalignment_rad"),
                    quadratic = of_group("quadratic_factor_s2_m"),
                    parasitic = of_group("parasitic_acceleration_m_s2"),
                    heads = of_group("star_tracker_bias_rad");
  Priors priors;
  for (std::size_t i = 0; i < num_parameters; ++i) priors[i] = {0.0, input.objectives[i]};
  const auto at = [&](Unknown unknown) -> Prior& { return priors[index(unknown)]; };
  at(Unknown::motion_gain) = scale.combined(Axis::x, 0.5, 0.5);
  at(Unknown::coupling_z) = coupling.combined(Axis::z, 0.5, 0.5);
  at(Unknown::coupling_y) = coupling.combined(Axis::y, 0.5, 0.5);
  at(Unknown::alignment_x) = angle.combined(Axis::x, 0.5, 0.5);
  const StarTracker tracker = make_star_tracker(input.noise, input.sample_period_s);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    priors[index(Unknown::tilt_x) + axis] = fused_bias(heads, tracker, axis);
  }
  at(Unknown::differential_bias) = parasitic.combined(Axis::x, -0.5, 0.5);
  at(Unknown::parasitic_y) = parasitic.combined(Axis::y, 0.5, 0.5);
  at(Unknown::parasitic_z) = parasitic.combined(Axis::z, 0.5, 0.5);
  for (const auto& [unknown, axis] :
       {std::pair{Unknown::scale_y, Axis::y}, std::pair{Unknown::scale_z, Axis::z}}) {
    const Prior k2d = quadratic.combined(axis, 0.5, -0.5);
    const Prior b = parasitic.combined(axis, -0.5, 0.5);
    at(unknown) = {2.0 * k2d.mean * b.mean, 2.0 * root_of_squares(k2d.deviation, k2d.mean) *
                                                root_of_squares(b.deviation, b.mean)};
  }
  return priors;
}

// Lines.

/// Variance of cosine's and sine's amplitude of Γ_mes,dx, half the difference of two sensors.
double line_variance(const EstimationInput& input, const Session& session,
                     const LineMultiple& line) {
  const double f = line_frequency_hz(session, line, input.orbit_period_s);
  const SensorNoise& x = input.noise.linear_x;
  const double rise = x.rise_asd * (f / x.rise_corner_hz) * (f / x.rise_corner_hz);
  const double limited = x.rise_limit_hz == 0.0 ? 0.0 : f / x.rise_limit_hz;
  const double density = x.white_asd * x.white_asd * (1.0 + x.pink_corner_hz / f) +
                         rise * rise / (1.0 + limited * limited * limited * limited);
  const double scale = input.noise.scale > 0.0 ? input.noise.scale : 1.0;
  const double duration_s = session.num_orbits * input.orbit_period_s - input.config.transient_s;
  return 0.5 * scale * scale * density / duration_s;
}

/// An observed line.
struct Line {
  std::size_t session;
  LineSignals signals;
  LinePhasors phasors;
  double weight;
};

std::vector<Line> observed_lines(const RunPhasors& records, const EstimationInput& input) {
  std::vector<Line> lines;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Session& session = input.sessions[i];
    const std::vector<WantedLine> wanted = joint_needs(session).lines;
    PROOFMASS_EXPECT(records[i].lines.size() == wanted.size());
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      const auto& [line, signals] = wanted[k];
      const LinePhasors& recorded = records[i].lines[k];
      lines.push_back(
          {i, signals,
           signals == LineSignals::squares ? centred(recorded, records[i].means) : recorded,
           1.0 / line_variance(input, session, line)});
    }
  }
  return lines;
}

// The fit.

/// Normal equations of the unknowns in units of their priors' deviations.
struct NormalEquations {
  NormalMatrix matrix = NormalMatrix::Zero();
  NormalVector vector = NormalVector::Zero();
  double chi_squared = 0.0;
  double num_data = 0.0;

  void add(const NormalVector& slope, double residual, double weight) {
    matrix += weight * slope * slope.transpose();
    vector += weight * residual * slope;
    chi_squared += weight * residual * residual;
    num_data += 1.0;
  }
};

class JointFit {
 public:
  JointFit(const RunPhasors& records, const EstimationInput& input)
      : records_(records),
        input_(input),
        priors_(make_priors(input)),
        lines_(observed_lines(records, input)),
        read_out_bias_(
            GroupPriors(input.dispersions, "read_out_bias_m_s2").combined(Axis::x, 0.5, -0.5)) {}

  [[nodiscard]] UnknownArray start() const {
    UnknownArray unknowns;
    for (std::size_t i = 0; i < num_unknowns; ++i) unknowns[i] = priors_[i].mean;
    return unknowns;
  }

  /// Of each session's lines, about these values.
  [[nodiscard]] std::vector<NormalEquations> of_sessions(const UnknownArray& unknowns) const {
    std::vector<LineCoefficients> coefficients;
    for (std::size_t i = 0; i < records_.size(); ++i) {
      coefficients.push_back(line_coefficients(input_.sessions[i], records_[i].means, unknowns));
    }
    std::vector<NormalEquations> equations(records_.size());
    for (const Line& line : lines_) {
      const Prediction model = predict(coefficients[line.session], line.signals, line.phasors);
      const std::complex<double> residual =
          line.phasors[index(Signal::differential_x)] - model.value;
      NormalVector cosine, sine;
      for (std::size_t i = 0; i < num_unknowns; ++i) {
        cosine[static_cast<Eigen::Index>(i)] = model.slope[i].real() * priors_[i].deviation;
        sine[static_cast<Eigen::Index>(i)] = model.slope[i].imag() * priors_[i].deviation;
      }
      equations[line.session].add(cosine, residual.real(), line.weight);
      equations[line.session].add(sine, residual.imag(), line.weight);
    }
    return equations;
  }

  /// What is known beside the lines: the priors, and the mean of the first session's Γ_mes,dx.
  [[nodiscard]] NormalEquations beside(const UnknownArray& unknowns) const {
    NormalEquations equations;
    for (std::size_t i = num_parameters; i < num_unknowns; ++i) {
      const NormalVector slope = NormalVector::Unit(static_cast<Eigen::Index>(i));
      equations.add(slope, (priors_[i].mean - unknowns[i]) / priors_[i].deviation, 1.0);
    }
    const Dual constant = differential_constant(records_[0].means, unknowns);
    NormalVector slope;
    for (std::size_t i = 0; i < num_unknowns; ++i) {
      slope[static_cast<Eigen::Index>(i)] = constant.slope[i] * priors_[i].deviation;
    }
    equations.add(
        slope,
        records_[0].means[index(Signal::differential_x)] - read_out_bias_.mean - constant.value,
        1.0 / (read_out_bias_.deviation * read_out_bias_.deviation));
    return equations;
  }

  [[nodiscard]] double unit(std::size_t unknown) const { return priors_[unknown].deviation; }

 private:
  const RunPhasors& records_;
  const EstimationInput& input_;
  Priors priors_;
  std::vector<Line> lines_;
  Prior read_out_bias_;
};

/// The solution of a fit linearised about some values.
struct Solution {
  NormalMatrix covariance;  ///< In units of the priors' deviations, as the step.
  NormalVector step;
};

Solution solve(const std::vector<NormalEquations>& sessions, const NormalEquations& beside) {
  NormalMatrix matrix = beside.matrix;
  NormalVector vector = beside.vector;
  for (const NormalEquations& session : sessions) {
    matrix += session.matrix;
    vector += session.vector;
  }
  const Eigen::LDLT<NormalMatrix> factors(matrix);
  return {factors.solve(NormalMatrix::Identity()), factors.solve(vector)};
}

/// Largest move of a parameter, in standard errors.
double largest_move(const Solution& solution) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(num_parameters); ++i) {
    largest = std::max(largest, std::abs(solution.step[i]) / std::sqrt(solution.covariance(i, i)));
  }
  return largest;
}

void set_errors(const NormalMatrix& covariance, const JointFit& fit, Estimation& estimation) {
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    estimation.standard_errors[i] = fit.unit(i) * std::sqrt(covariance(row, row));
    for (std::size_t j = 0; j < num_parameters; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      estimation.correlations[i][j] =
          covariance(row, column) / std::sqrt(covariance(row, row) * covariance(column, column));
    }
  }
}

}  // namespace

Estimation estimate_joint(const RunPhasors& records, const EstimationInput& input) {
  PROOFMASS_EXPECT(records.size() == input.sessions.size());
  const JointFit fit(records, input);
  UnknownArray unknowns = fit.start();
  Estimation result;
  double last_move = 0.0;
  while (!result.converged && result.num_rounds < input.config.num_rounds_max) {
    const Solution solution = solve(fit.of_sessions(unknowns), fit.beside(unknowns));
    for (std::size_t i = 0; i < num_unknowns; ++i) {
      unknowns[i] += fit.unit(i) * solution.step[static_cast<Eigen::Index>(i)];
    }
    last_move = largest_move(solution);
    result.converged = last_move <= input.config.convergence;
    ++result.num_rounds;
  }
  const std::vector<NormalEquations> sessions = fit.of_sessions(unknowns);
  const Solution at_end = solve(sessions, fit.beside(unknowns));
  for (const NormalEquations& session : sessions) {
    const double adapted = (session.matrix * at_end.covariance).trace();
    result.session_fits.push_back({session.chi_squared, session.num_data - adapted});
  }
  std::copy_n(unknowns.begin(), num_parameters, result.values.begin());
  set_errors(at_end.covariance, fit, result);
  result.diagnostics = {{"last_move", last_move}};
  return result;
}

JointInformation::JointInformation(const RunPhasors& records, const EstimationInput& input,
                                   const UnknownArray& unknowns) {
  const JointFit fit(records, input);
  for (const NormalEquations& session : fit.of_sessions(unknowns)) {
    sessions_.emplace_back(session.matrix);
  }
  beside_ = fit.beside(unknowns).matrix;
  for (std::size_t i = 0; i < num_parameters; ++i) units_[i] = fit.unit(i);
}

ParameterArray JointInformation::standard_errors(std::span<const double> factors) const {
  PROOFMASS_EXPECT(factors.size() == sessions_.size());
  NormalMatrix matrix = beside_;
  for (std::size_t i = 0; i < factors.size(); ++i) matrix += factors[i] * sessions_[i];
  // With the nuisances in front, the last rows of the factor are that of what the lines tell of the
  // parameters while the nuisances are free.
  constexpr auto num_wanted = static_cast<Eigen::Index>(num_parameters);
  const NormalMatrix reversed = matrix.reverse();
  const Eigen::LLT<NormalMatrix> decomposition(reversed);
  ParameterArray errors;
  errors.fill(std::numeric_limits<double>::infinity());
  if (decomposition.info() != Eigen::Success) return errors;  // Something is not determined.
  const NormalMatrix factor = decomposition.matrixL();
  using Square = Eigen::Matrix<double, num_wanted, num_wanted>;
  const Square last = factor.bottomRightCorner<num_wanted, num_wanted>();
  const Square inverse = last.triangularView<Eigen::Lower>().solve(Square::Identity());
  for (std::size_t i = 0; i < num_parameters; ++i) {
    errors[i] = units_[i] * inverse.col(num_wanted - 1 - static_cast<Eigen::Index>(i)).norm();
  }
  return errors;
}

namespace {

/// factor·f of an excitation plus orbital·f_orb.
LineMultiple multiple(std::size_t excitation, double factor, double orbital) {
  LineMultiple line{.orbital = orbital};
  (excitation == 0 ? line.excitation : line.further[excitation - 1]) = factor;
  return line;
}

bool moves_apart(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::test_mass && excitation.axis != Axis::x &&
         excitation.motion == MassMotion::opposition;
}

/// Whether the squares of Γ_mes,kx tell at 2 f of K2.
bool tells_of_squares(const Excitation& excitation) {
  if (excitation.axis != Axis::x) return false;
  return excitation.kind == ExcitationKind::drag_free ||
         (excitation.kind == ExcitationKind::test_mass &&
          excitation.motion != MassMotion::opposition);
}

/// Two that shake X make lines at sum and difference of their frequencies, of K2 times both: 1e-11
/// m/s², which tell no more than the squares do, and leak.
void add_products(const std::vector<Excitation>& excitations, RecordNeeds& needs) {
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    for (std::size_t j = i + 1; j < excitations.size(); ++j) {
      if (!tells_of_squares(excitations[i]) || !tells_of_squares(excitations[j])) continue;
      for (const double sign : {1.0, -1.0}) {
        LineMultiple product = multiple(i, 1.0, 0.0);
        product.further[j - 1] = sign;
        needs.neighbours.push_back(product);
      }
    }
  }
}

}  // namespace

RecordNeeds joint_needs(const Session& session) {
  RecordNeeds needs{.signals = SignalSet::health};
  const std::vector<Excitation>& excitations = session.excitations;
  needs.lines.push_back({{.orbital = 2.0}, LineSignals::gradients});
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind == ExcitationKind::test_mass) continue;
    needs.lines.push_back({multiple(i, 1.0, 0.0), LineSignals::gradients});
  }
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!tells_of_squares(excitations[i])) continue;
    needs.lines.push_back({multiple(i, 2.0, 0.0), LineSignals::squares});
  }
  const MassExcitations motions = mass_excitations(session);
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!moves_apart(excitations[i])) continue;
    const bool is_first = &excitations[i] == motions[0];
    for (const double orbital : {2.0, -2.0}) {
      needs.lines.push_back(
          {multiple(i, 1.0, orbital), is_first ? LineSignals::moved : LineSignals::moved_again});
    }
  }
  // Lines of which the model of another line has no term: they must not leak into it. A line that
  // the model describes may leak, because its signals leak alike.
  needs.neighbours = {{.orbital = 1.0}, {.orbital = 3.0}};
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind != ExcitationKind::test_mass) continue;
    for (const double orbital : {0.0, 2.0, -2.0}) {
      needs.neighbours.push_back(multiple(i, 1.0, orbital));
    }
    // The signals of one motion do not tell what leaks from the other one.
    if (motions[1] == nullptr) continue;
    for (const double orbital : {1.0, -1.0, 3.0, -3.0}) {
      needs.neighbours.push_back(multiple(i, 1.0, orbital));
    }
  }
  add_products(excitations, needs);
  return needs;
}

void check_joint(const std::vector<Session>& sessions) {
  std::vector<std::string> lacks;
  const auto require = [&](std::string_view what, const auto& is_it) {
    for (const Session& session : sessions) {
      if (std::ranges::any_of(session.excitations, is_it)) return;
    }
    lacks.push_back(fmt::format("one that {}", what));
  };
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (sessions[i].spin_rate_rad_s == 0.0) continue;
    throw ConfigError(fmt::format("session[{}].spin_rate_rad_s", i),
                      fmt::format("{}", sessions[i].spin_rate_rad_s),
                      "estimation.method = \"joint\" needs 0");
  }
  for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
    require(fmt::format("pushes along {}", names_of(axis)[index(axis)]),
            [axis](const Excitation& e) {
              return e.kind == ExcitationKind::drag_free && e.axis == axis;
            });
  }
  require("turns about z", [](const Excitation& e) {
    return e.kind == ExcitationKind::attitude && e.axis == Axis::z;
  });
  for (const Axis axis : {Axis::y, Axis::z}) {
    require(fmt::format("moves masses in opposition along {}", names_of(axis)[index(axis)]),
            [axis](const Excitation& e) { return moves_apart(e) && e.axis == axis; });
  }
  require("moves one mass along x", [](const Excitation& e) {
    return e.kind == ExcitationKind::test_mass && tells_of_squares(e);
  });
  if (lacks.empty()) return;
  throw ConfigError("session",
                    fmt::format("{} session{}", sessions.size(), sessions.size() == 1 ? "" : "s"),
                    fmt::format("estimation.method = \"joint\" needs {}", fmt::join(lacks, ", ")));
}

}  // namespace proofmass
