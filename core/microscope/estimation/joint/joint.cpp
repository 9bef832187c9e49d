#include "core/microscope/estimation/joint/joint.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
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

constexpr std::size_t num_nuisances = num_unknowns - num_parameters;
using NuisanceMatrix = Eigen::Matrix<double, num_nuisances, num_nuisances>;
using NuisanceVector = Eigen::Matrix<double, num_nuisances, 1>;

/// Factors of the drawn quantities in a sum of them.
using Combination = Eigen::Matrix<double, num_drawn, 1>;

/// first·(the axis of sensor 1) + second·(that of sensor 2).
Combination of_pair(std::string_view name, Axis axis, double first, double second) {
  Combination factors = Combination::Zero();
  const auto at = static_cast<Eigen::Index>(draw_group(name).first + index(axis));
  factors[at] = first;
  factors[at + 3] = second;
  return factors;
}

/// Bias of the fused angles about an axis, from those of the heads.
Combination fused_bias(const StarTracker& tracker, Eigen::Index axis) {
  Combination factors = Combination::Zero();
  const auto first = static_cast<Eigen::Index>(draw_group("star_tracker_bias_rad").first);
  for (Eigen::Index i = 0; i < 6; ++i) {
    factors[first + i] = tracker.weight[static_cast<std::size_t>(i / 3)](axis, i % 3);
  }
  return factors;
}

/// The means and the covariance of what is drawn, for sums of it. No quantity is known to more than
/// a millionth of its nominal bound.
class DrawnSums {
 public:
  explicit DrawnSums(const DrawnMoments& moments)
      : mean_(Eigen::Map<const Combination>(moments.mean.data())), covariance_(moments.covariance) {
    for (const DrawGroup& group : draw_groups()) {
      const double least = 1e-6 * group.bound;
      covariance_.diagonal()
          .segment(static_cast<Eigen::Index>(group.first), static_cast<Eigen::Index>(group.count))
          .array() += least * least;
    }
  }

  [[nodiscard]] double mean(const Combination& sum) const { return mean_.dot(sum); }
  [[nodiscard]] double variance(const Combination& sum) const { return sum.dot(covariance_ * sum); }
  [[nodiscard]] double mean_square(const Combination& sum) const {
    return variance(sum) + mean(sum) * mean(sum);
  }
  [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }

 private:
  Combination mean_;
  Eigen::MatrixXd covariance_;
};

/// What is known of the unknowns beforehand.
struct Priors {
  /// Of the nuisances; the parameters start at 0.
  UnknownArray mean{};
  /// What the fit counts each unknown in: the deviation of a nuisance, the objective of a
  /// parameter.
  UnknownArray unit{};
  NuisanceMatrix information;  ///< Inverse of the nuisances' correlations.
};

/// Sums of drawn quantities that the nuisances are, except for scales and squares.
Eigen::Matrix<double, num_drawn, num_nuisances> nuisance_sums(const EstimationInput& input) {
  Eigen::Matrix<double, num_drawn, num_nuisances> sums;
  sums.setZero();
  const auto set = [&](Unknown unknown, const Combination& sum) {
    sums.col(static_cast<Eigen::Index>(index(unknown) - num_parameters)) = sum;
  };
  set(Unknown::motion_gain, of_pair("scale_factor_error", Axis::x, 0.5, 0.5));
  set(Unknown::coupling_z, of_pair("coupling_rad", Axis::z, 0.5, 0.5));
  set(Unknown::coupling_y, of_pair("coupling_rad", Axis::y, 0.5, 0.5));
  set(Unknown::alignment_x, of_pair("misalignment_rad", Axis::x, 0.5, 0.5));
  const StarTracker tracker = make_star_tracker(input.noise, input.sample_period_s);
  set(Unknown::tilt_x, fused_bias(tracker, 0));
  set(Unknown::tilt_y, fused_bias(tracker, 1));
  set(Unknown::tilt_z, fused_bias(tracker, 2));
  constexpr std::string_view parasitic = "parasitic_acceleration_m_s2";
  set(Unknown::differential_bias, of_pair(parasitic, Axis::x, -0.5, 0.5));
  set(Unknown::parasitic_y, of_pair(parasitic, Axis::y, 0.5, 0.5));
  set(Unknown::parasitic_z, of_pair(parasitic, Axis::z, 0.5, 0.5));
  return sums;
}

Priors make_priors(const EstimationInput& input, const DrawnSums& drawn) {
  const auto sums = nuisance_sums(input);
  NuisanceMatrix covariance = sums.transpose() * drawn.covariance() * sums;
  Priors priors;
  for (std::size_t i = num_parameters; i < num_unknowns; ++i) {
    priors.mean[i] = drawn.mean(sums.col(static_cast<Eigen::Index>(i - num_parameters)));
  }
  const auto set = [&](Unknown unknown, double mean, double variance) {
    const auto row = static_cast<Eigen::Index>(index(unknown) - num_parameters);
    priors.mean[index(unknown)] = mean;
    covariance(row, row) = variance;
  };
  for (const auto& [scale, square, axis] :
       {std::tuple{Unknown::scale_y, Unknown::square_y, Axis::y},
        std::tuple{Unknown::scale_z, Unknown::square_z, Axis::z}}) {
    const Combination k2d = of_pair("quadratic_factor_s2_m", axis, 0.5, -0.5);
    const Combination k2c = of_pair("quadratic_factor_s2_m", axis, 0.5, 0.5);
    const Combination b = of_pair("parasitic_acceleration_m_s2", axis, -0.5, 0.5);
    // A product of two sums, which are taken for independent, and a square of one that is taken for
    // normal.
    const double product = 2.0 * drawn.mean(k2d) * drawn.mean(b);
    set(scale, product, 4.0 * drawn.mean_square(k2d) * drawn.mean_square(b) - product * product);
    const double mean = drawn.mean(k2c), variance = drawn.variance(k2c);
    set(square, mean * mean + variance, 2.0 * variance * (variance + 2.0 * mean * mean));
  }
  const NuisanceVector deviation = covariance.diagonal().cwiseSqrt();
  NuisanceMatrix correlations =
      deviation.cwiseInverse().asDiagonal() * covariance * deviation.cwiseInverse().asDiagonal();
  correlations.diagonal().array() += 1e-9;  // Laws may tie one nuisance to another.
  priors.information = Eigen::LDLT<NuisanceMatrix>(correlations).solve(NuisanceMatrix::Identity());
  // Whatever the objectives are, squares of these units are numbers.
  std::ranges::transform(input.objectives, priors.unit.begin(),
                         [](double objective) { return std::clamp(objective, 1e-30, 1e6); });
  std::copy_n(deviation.data(), num_nuisances, priors.unit.begin() + num_parameters);
  return priors;
}

// Lines.

/// Variance of cosine's and sine's amplitude of Γ_mes,dx, half the difference of two sensors.
double line_variance(const EstimationInput& input, const Session& session, const LineMultiple& line,
                     const BandPass& filter) {
  const double f = line_frequency_hz(session, line, input.orbit_period_s);
  const double density = differential_x_density(input.noise, [f](const SensorNoise& x) {
    const double rise = x.rise_asd * (f / x.rise_corner_hz) * (f / x.rise_corner_hz);
    const double limited = x.rise_limit_hz == 0.0 ? 0.0 : f / x.rise_limit_hz;
    return x.white_asd * x.white_asd * (1.0 + x.pink_corner_hz / f) +
           rise * rise / (1.0 + limited * limited * limited * limited);
  });
  const double scale = input.noise.scale > 0.0 ? input.noise.scale : 1.0;
  const double duration_s = session.num_orbits * input.orbit_period_s - input.config.transient_s;
  const double passed = std::norm(response(filter, f, input.sample_period_s));
  return scale * scale * density * passed / duration_s;
}

/// What a line has of a push, and what the low-pass makes of it there.
struct LinePush {
  Push push;
  PushLine line;
  std::complex<double> gain;
};

/// An observed line.
struct Line {
  std::size_t session;
  LineSignals signals;
  LinePhasors phasors;
  double weight;
  std::optional<LinePush> push{};
};

/// The pushes of a session, at their lines in the order of RecordNeeds::lines.
class SessionPushes {
 public:
  SessionPushes(const Session& session, const RecordNeeds& needs, const SessionPhasors& record,
                const BandPass& filter, const EstimationInput& input)
      : needs_(needs) {
    for (const WantedLine& wanted : needs.lines) {
      const double f = line_frequency_hz(session, wanted.line, input.orbit_period_s);
      // The phasor of a cosine is 1, that of a sine i: the other way round than e^(iωt) counts.
      gains_.push_back(std::conj(response(filter, f, input.sample_period_s)));
    }
    for (std::size_t i = 0; i < session.excitations.size(); ++i) {
      const Excitation& excitation = session.excitations[i];
      if (excitation.kind != ExcitationKind::drag_free) continue;
      Push push{.axis = excitation.axis};
      const std::size_t signal = index(Signal::common_x) + index(excitation.axis);
      for (std::size_t k = 0; k < needs.lines.size(); ++k) {
        if (is_multiple(k, i, 1.0)) push.at_f = record.lines[k][signal] / gains_[k];
        if (is_multiple(k, i, 2.0)) push.at_2f = record.lines[k][signal] / gains_[k];
      }
      pushes_.push_back({i, push});
    }
    for (auto& [i, push] : pushes_) {
      for (const auto& [j, other] : pushes_) {
        if (i == j || other.axis != push.axis) continue;
        push.square_of_others_m2_s4 += std::norm(other.at_f);
      }
    }
  }

  [[nodiscard]] std::optional<LinePush> at(std::size_t k) const {
    for (const auto& [i, push] : pushes_) {
      if (is_multiple(k, i, 1.0)) return LinePush{push, PushLine::at_f, gains_[k]};
      if (is_multiple(k, i, 2.0)) return LinePush{push, PushLine::at_2f, gains_[k]};
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] bool is_multiple(std::size_t k, std::size_t excitation, double factor) const {
    return needs_.lines[k].line == excitation_multiple(excitation, factor);
  }

  const RecordNeeds& needs_;
  std::vector<std::complex<double>> gains_;
  std::vector<std::pair<std::size_t, Push>> pushes_;
};

std::vector<Line> observed_lines(const RunPhasors& records, const EstimationInput& input) {
  std::vector<Line> lines;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Session& session = input.sessions[i];
    const RecordNeeds needs = joint_needs(session);
    const BandPass filter = further_lines_filter(needs, session, input.config, input.orbit_period_s,
                                                 input.sample_period_s);
    PROOFMASS_EXPECT(records[i].lines.size() == needs.lines.size());
    const SessionPushes pushes(session, needs, records[i], filter, input);
    for (std::size_t k = 0; k < needs.lines.size(); ++k) {
      const auto& [line, signals] = needs.lines[k];
      const LinePhasors& recorded = records[i].lines[k];
      lines.push_back(
          {i, signals,
           signals == LineSignals::squares ? centred(recorded, records[i].means) : recorded,
           1.0 / line_variance(input, session, line, filter), pushes.at(k)});
    }
  }
  return lines;
}

// The fit.

/// Normal equations of the unknowns, these in Priors::unit.
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
      : records_(records), input_(input), lines_(observed_lines(records, input)) {
    const DrawnSums drawn(input.laws);
    priors_ = make_priors(input, drawn);
    const Combination bias = of_pair("read_out_bias_m_s2", Axis::x, 0.5, -0.5);
    read_out_bias_m_s2_ = drawn.mean(bias);
    read_out_variance_ = drawn.variance(bias);
  }

  [[nodiscard]] UnknownArray start() const { return priors_.mean; }

  /// Of each session's lines, about these values.
  [[nodiscard]] std::vector<NormalEquations> of_sessions(const UnknownArray& unknowns) const {
    const DragFreeSource found = drag_free_of_a_d11_prime(input_.sessions);
    std::vector<LineCoefficients> coefficients;
    for (std::size_t i = 0; i < records_.size(); ++i) {
      coefficients.push_back(
          line_coefficients(input_.sessions[i], records_[i].means, unknowns, found));
    }
    std::vector<NormalEquations> equations(records_.size());
    for (const Line& line : lines_) {
      const Prediction model = prediction(coefficients[line.session], line, unknowns);
      const std::complex<double> residual =
          line.phasors[index(Signal::differential_x)] - model.value;
      NormalVector cosine, sine;
      for (std::size_t i = 0; i < num_unknowns; ++i) {
        cosine[static_cast<Eigen::Index>(i)] = model.slope[i].real() * priors_.unit[i];
        sine[static_cast<Eigen::Index>(i)] = model.slope[i].imag() * priors_.unit[i];
      }
      equations[line.session].add(cosine, residual.real(), line.weight);
      equations[line.session].add(sine, residual.imag(), line.weight);
    }
    return equations;
  }

  /// What is known beside the lines: the priors, and the mean of the first calibration's Γ_mes,dx.
  [[nodiscard]] NormalEquations beside(const UnknownArray& unknowns) const {
    NormalEquations equations;
    NuisanceVector residual;
    for (std::size_t i = num_parameters; i < num_unknowns; ++i) {
      residual[static_cast<Eigen::Index>(i - num_parameters)] =
          (priors_.mean[i] - unknowns[i]) / priors_.unit[i];
    }
    equations.matrix.bottomRightCorner<num_nuisances, num_nuisances>() = priors_.information;
    equations.vector.tail<num_nuisances>() = priors_.information * residual;
    const auto calibration = static_cast<std::size_t>(
        std::ranges::find_if_not(input_.sessions, is_test) - input_.sessions.begin());
    const auto& means = records_[calibration].means;
    const Dual constant = mean_differential(means, unknowns, mean_square_of_pushes(calibration));
    NormalVector slope;
    for (std::size_t i = 0; i < num_unknowns; ++i) {
      slope[static_cast<Eigen::Index>(i)] = constant.slope[i] * priors_.unit[i];
    }
    equations.add(slope,
                  means[index(Signal::differential_x)] - read_out_bias_m_s2_ - constant.value,
                  1.0 / read_out_variance_);
    return equations;
  }

  [[nodiscard]] double unit(std::size_t unknown) const { return priors_.unit[unknown]; }

 private:
  /// Of what a session pushes along X, as Γ_mes,cx shows it, m²/s⁴.
  [[nodiscard]] double mean_square_of_pushes(std::size_t session) const {
    double sum = 0.0;
    for (const Line& line : lines_) {
      if (line.session != session || !line.push || line.push->line != PushLine::at_f) continue;
      if (line.push->push.axis == Axis::x) sum += 0.5 * std::norm(line.push->push.at_f);
    }
    return sum;
  }

  [[nodiscard]] Prediction prediction(const LineCoefficients& coefficients, const Line& line,
                                      const UnknownArray& unknowns) const {
    Prediction model = predict(coefficients, line.signals, line.phasors);
    if (!line.push) return model;
    const auto& [push, at, gain] = *line.push;
    const Prediction terms =
        push_terms(input_.sessions[line.session].drag_free, unknowns, push, at);
    model.value += gain * terms.value;
    for (std::size_t i = 0; i < num_unknowns; ++i) model.slope[i] += gain * terms.slope[i];
    return model;
  }

  const RunPhasors& records_;
  const EstimationInput& input_;
  std::vector<Line> lines_;
  Priors priors_;
  double read_out_bias_m_s2_ = 0.0;  ///< Half difference along X, expected.
  double read_out_variance_ = 0.0;   ///< Of it, m²/s⁴.
};

/// The solution of a fit linearised about some values.
struct Solution {
  NormalMatrix covariance;  ///< In Priors::unit, as the step.
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
  while (!result.converged && result.num_rounds < input.config.num_rounds_max) {
    const Solution solution = solve(fit.of_sessions(unknowns), fit.beside(unknowns));
    for (std::size_t i = 0; i < num_unknowns; ++i) {
      unknowns[i] += fit.unit(i) * solution.step[static_cast<Eigen::Index>(i)];
    }
    result.converged = largest_move(solution) <= input.config.convergence;
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

Eigen::MatrixXd JointInformation::information(std::span<const double> factors) const {
  PROOFMASS_EXPECT(factors.size() == sessions_.size());
  Eigen::MatrixXd matrix = beside_;
  for (std::size_t i = 0; i < factors.size(); ++i) matrix += factors[i] * sessions_[i];
  return matrix;
}

ParameterArray JointInformation::standard_errors(std::span<const double> factors,
                                                 std::optional<Unknown> known) const {
  // With the nuisances in front, the last rows of the factor are that of what the lines tell of the
  // parameters while the nuisances are free.
  constexpr auto num_wanted = static_cast<Eigen::Index>(num_parameters);
  Eigen::MatrixXd matrix = information(factors);
  if (known) {
    const auto row = static_cast<Eigen::Index>(index(*known));
    matrix(row, row) *= 1e9;
  }
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

}  // namespace proofmass
