#include "core/microscope/planning/plan_study.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/planning/probed_runs.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// Drawn instruments that a bound is the mean over. The standard error of a_c11Δx scatters by 45 %
/// from one to another.
constexpr std::uint64_t num_instruments_max = 256;

/// Most orbits of a session that a campaign file may have.
constexpr int num_session_orbits_max = 10'000;

EstimationMethod method_named(std::string_view name) {
  const auto methods = estimation_methods();
  const auto found = std::ranges::find(methods, name, &EstimationMethodInfo::name);
  return static_cast<EstimationMethod>(found - methods.begin() + 1);
}

/// A short campaign without noise and without the errors of instruments, which change the
/// amplitudes of lines by a percent, without saturation, which the probes show, and without what
/// other methods record.
MicroscopeCampaign measured_campaign(MicroscopeCampaign campaign) {
  campaign.scenario.noise.scale = 0.0;
  campaign.scenario.sensor.range_m_s2 = 1.0;
  for (Dispersion& dispersion : campaign.dispersions) {
    dispersion = {.law = Law::fixed, .file = {}, .column = {}};
  }
  for (Session& session : campaign.scenario.sessions) {
    session.target = SessionTarget::no_target;
    session.fit_lines = {{2.0}};
    session.known_lines.clear();
  }
  return campaign;
}

// The chance that all objectives hold, in logarithms: they have slopes where it rounds to 0 or 1.

/// Probability that a normal variable is beyond x standard deviations, x ≥ 0.
double beyond(double x) { return 2.0 * normal_cumulative(-x); }

/// log beyond(x).
double log_beyond(double x) {
  if (x < 36.0) return logarithm(beyond(x));
  const double y = 1.0 / (x * x);  // √(2/π) e^(−x²/2)/x (1 − y + 3y² − 15y³ + …).
  return -0.5 * x * x + logarithm(std::sqrt(2.0 / std::numbers::pi) / x *
                                  (1.0 - y * (1.0 - 3.0 * y * (1.0 - 5.0 * y))));
}

/// log(1 − beyond(x)).
double log_within(double x) {
  if (x == 0.0) return -std::numeric_limits<double>::infinity();
  if (x > 0.05) return logarithm(1.0 - beyond(x));
  const double y = x * x;  // √(2/π) x (1 − y/6 + y²/40 − …).
  return logarithm(std::sqrt(2.0 / std::numbers::pi) * x * (1.0 - y * (1.0 / 6.0 - y / 40.0)));
}

/// log of the sum of e^x.
double log_sum_exp(std::span<const double> x) {
  const double largest = std::ranges::max(x);
  if (std::isinf(largest)) return largest;
  double sum = 0.0;
  for (const double each : x) sum += exponential(std::max(each - largest, -699.0));
  return largest + logarithm(sum);
}

/// That one or more objectives are missed.
struct MissChance {
  double miss = 0.0;
  double log_miss = 0.0;  ///< Also where `miss` is 0 to double precision.
  double log_hold = 0.0;  ///< log(1 − miss), also where that is.
};

MissChance miss_chance(const ParameterArray& objectives, const ParameterArray& errors) {
  MissChance chance;
  ParameterArray log_misses;
  double log_hold = 0.0;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const double x = objectives[i] / errors[i];
    const double miss = beyond(x);
    chance.miss += miss - chance.miss * miss;
    log_misses[i] = log_beyond(x);
    log_hold += log_within(x);
  }
  chance.log_miss = chance.miss > 1e-290 ? logarithm(chance.miss) : log_sum_exp(log_misses);
  chance.log_hold = chance.miss < 0.5 ? logarithm(1.0 - chance.miss) : log_hold;
  return chance;
}

/// The campaign as `joint` calibrates, without tests.
/// @throws ConfigError if it cannot use the sessions.
MicroscopeCampaign calibration_of(MicroscopeCampaign campaign) {
  campaign.scenario.validate();
  check_joint_campaign(campaign);
  std::erase_if(campaign.scenario.sessions, is_test);
  return campaign;
}

MicroscopeCampaign with_joint(MicroscopeCampaign campaign) {
  campaign.scenario.estimation.method = method_named(joint_method.name);
  return campaign;
}

class JointStudy final : public PlanStudy {
 public:
  explicit JointStudy(const MicroscopeCampaign& campaign)
      : whole_(with_joint(campaign)), campaign_(calibration_of(whole_)) {
    const Scenario& scenario = campaign_.scenario;
    const MicroscopeCampaign measured = measured_campaign(short_campaign(campaign_));
    for (const Session& session : measured.scenario.sessions) {
      measured_orbits_.push_back(session.num_orbits);
    }
    const RunRecord record = RunPlan(measured, joint_method).record(RunIndex{0}, {});
    const DrawnMoments laws = drawn_moments(campaign_.dispersions);
    const EstimationInput input{.sessions = measured.scenario.sessions,
                                .config = scenario.estimation,
                                .objectives = scenario.objectives,
                                .noise = scenario.noise,
                                .attitude = scenario.attitude,
                                .laws = laws,
                                .orbit_period_s = scenario.orbit.period_s,
                                .sample_period_s = scenario.simulation.sample_period_s};
    probes_.emplace(whole_, add_instruments(record.phasors, input));
    scope_ = {
        .method = std::string(joint_method.name),
        .num_steps_min = joint_orbits_min(scenario.orbit.period_s, scenario.estimation.transient_s),
        .num_steps_max = num_session_orbits_max,
        .num_instruments = instruments_.size(),
        .num_probed = probes_->size(),
        .num_misfits = probes_->num_misfits(),
        .misfits = probes_->misfit_sessions(),
        .probed_level = probes_->level_m_s2()};
    for (const Session& session : whole_.scenario.sessions) {
      if (is_test(session)) {
        scope_.num_steps_beside += session.num_orbits;
        continue;
      }
      scope_.sessions.push_back(session.name);
      scope_.num_steps.push_back(session.num_orbits);
    }
  }

  [[nodiscard]] const PlanScope& scope() const override { return scope_; }

  [[nodiscard]] std::string remedy(std::size_t quantity) const override {
    const auto parameter = static_cast<Parameter>(quantity);
    const std::string_view what = what_determines(parameter);
    if (what.empty()) return "longer sessions";
    const Scenario& scenario = campaign_.scenario;
    const PushLimits limits = push_limits(drawn_moments(campaign_.dispersions),
                                          scenario.objectives[index(Parameter::a_d11_prime)]);
    return may_be_larger(scenario.sessions, parameter, limits)
               ? fmt::format("a session that {}, longer or with a larger amplitude", what)
               : fmt::format("a longer session that {}", what);
  }

  [[nodiscard]] std::string limit(std::size_t quantity) const override {
    const std::vector<double> endless(measured_orbits_.size(), 1e6);
    const auto sigma = [&](std::optional<Unknown> known) {
      double sum = 0.0;
      for (const JointInformation& instrument : instruments_) {
        sum += instrument.standard_errors(endless, known)[quantity];
      }
      return sum / static_cast<double>(instruments_.size());
    };
    if (sigma({}) <= campaign_.scenario.objectives[quantity]) return {};
    std::optional<Unknown> most;
    for (std::size_t i = num_parameters; i < num_unknowns; ++i) {
      const Unknown nuisance{i};
      if (!most || sigma(nuisance) < sigma(most)) most = nuisance;
    }
    return std::string(name_of(*most));
  }

  [[nodiscard]] PlanBound bound(std::span<const int> num_orbits) const override {
    const std::vector<ParameterArray> errors = standard_errors(num_orbits);
    PlanBound bound{.standard_errors = means(errors),
                    .misses = std::vector<double>(num_parameters)};
    probes_->judge(with_lengths(num_orbits).scenario, errors, bound);
    const double part = 1.0 / static_cast<double>(errors.size());
    const ParameterArray& objectives = campaign_.scenario.objectives;
    for (const ParameterArray& of_instrument : errors) {
      for (std::size_t i = 0; i < num_parameters; ++i) {
        bound.misses[i] += part * beyond(objectives[i] / of_instrument[i]);
      }
      bound.misses_any += part * miss_chance(objectives, of_instrument).miss;
    }
    // A run that is lost misses everything.
    const double lost =
        static_cast<double>(bound.num_lost()) / static_cast<double>(probes_->size());
    for (double& miss : bound.misses) miss += lost * (1.0 - miss);
    bound.misses_any += lost * (1.0 - bound.misses_any);
    if (campaign_.error_budget()) bound.mean_budget = mean_budget(bound.standard_errors);
    return bound;
  }

  [[nodiscard]] double merit(PlanGoal goal, std::span<const int> num_orbits) const override {
    const std::vector<ParameterArray> errors = standard_errors(num_orbits);
    if (goal == PlanGoal::budget) return -mean_budget(means(errors));
    std::vector<double> hold, miss;
    for (const ParameterArray& of_instrument : errors) {
      const MissChance chance = miss_chance(campaign_.scenario.objectives, of_instrument);
      hold.push_back(chance.log_hold);
      miss.push_back(chance.log_miss);
    }
    return log_sum_exp(hold) - log_sum_exp(miss);
  }

  [[nodiscard]] std::string campaign_file(std::span<const int> num_orbits) const override {
    const MicroscopeCampaign campaign = with_lengths(num_orbits);
    campaign.validate();
    return commented_campaign(campaign);
  }

 private:
  /// Record of a session that its lines are fitted to.
  [[nodiscard]] double fitted_s(int num_orbits) const {
    return num_orbits * campaign_.scenario.orbit.period_s -
           campaign_.scenario.estimation.transient_s;
  }

  /// The whole campaign, if the sessions that calibrate had these lengths.
  [[nodiscard]] MicroscopeCampaign with_lengths(std::span<const int> num_orbits) const {
    MicroscopeCampaign campaign = whole_;
    std::size_t i = 0;
    for (Session& session : campaign.scenario.sessions) {
      if (!is_test(session)) session.num_orbits = num_orbits[i++];
    }
    return campaign;
  }

  /// Of each instrument, if the sessions had these lengths.
  [[nodiscard]] std::vector<ParameterArray> standard_errors(std::span<const int> num_orbits) const {
    std::vector<double> factors;
    for (std::size_t i = 0; i < num_orbits.size(); ++i) {
      factors.push_back(std::max(0.0, fitted_s(num_orbits[i])) / fitted_s(measured_orbits_[i]));
    }
    std::vector<ParameterArray> errors;
    errors.reserve(instruments_.size());
    for (const JointInformation& instrument : instruments_) {
      errors.push_back(instrument.standard_errors(factors));
    }
    return errors;
  }

  [[nodiscard]] static std::vector<double> means(const std::vector<ParameterArray>& errors) {
    std::vector<double> means(num_parameters);
    for (const ParameterArray& of_instrument : errors) {
      for (std::size_t i = 0; i < num_parameters; ++i) {
        means[i] += of_instrument[i] / static_cast<double>(errors.size());
      }
    }
    return means;
  }

  /// Of the mean of |error|, which is σ √(2/π) of a normal law.
  [[nodiscard]] double mean_budget(std::vector<double> errors) const {
    for (double& error : errors) error *= std::sqrt(2.0 / std::numbers::pi);
    const ErrorBudget budget = campaign_.error_budget().value();
    return budget.after(errors, scope_.probed_level).total;
  }

  /// @return The runs that have these instruments.
  std::vector<RunIndex> add_instruments(const RunPhasors& phasors, const EstimationInput& input) {
    // A table has values for the runs of the campaign only.
    const std::uint64_t each = campaign_.realisations;
    const std::uint64_t num_drawn =
        campaign_.table_quantities().empty()
            ? num_instruments_max
            : std::min((campaign_.num_runs + each - 1) / each, num_instruments_max);
    std::vector<RunIndex> runs;
    for (std::uint64_t i = 0; i < num_drawn; ++i) {
      const RunIndex run{i * each};
      const AcceptedDraw draw = draw_instrument(campaign_, run, campaign_.table_values(run));
      if (!draw.instrument) continue;
      const double offset_m_s2 = common_offset_x(campaign_.scenario, *draw.instrument);
      instruments_.emplace_back(phasors, input, true_unknowns(*draw.instrument, offset_m_s2));
      runs.push_back(run);
    }
    if (instruments_.empty()) throw Error("no bound: no instrument is accepted");
    const std::vector<ParameterArray> errors = standard_errors(measured_orbits_);
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (!std::ranges::all_of(errors[i], is_in_range)) refuse_undetermined(instruments_[i]);
    }
    return runs;
  }

  /// @throws ConfigError naming the parameters that the sessions do not determine, or Error.
  [[noreturn]] void refuse_undetermined(const JointInformation& instrument) const {
    const std::vector<double> factors(measured_orbits_.size(), 1.0);
    const Eigen::MatrixXd information = instrument.information(factors);
    if (!information.allFinite()) throw Error("no bound: the loops are not stable");
    std::vector<std::string> texts;
    for (const std::size_t unknown : undetermined_by(information)) {
      if (unknown >= num_parameters) break;  // Nuisances have priors.
      texts.push_back(fmt::format("{} by {}", microscope_results().quantities[unknown].symbol,
                                  remedy(unknown)));
    }
    throw ConfigError("session", fmt::format("{} sessions", measured_orbits_.size()),
                      fmt::format("must determine {}", fmt::join(texts, ", and ")));
  }

  MicroscopeCampaign whole_;          ///< With its sessions that test.
  MicroscopeCampaign campaign_;       ///< Of those that calibrate.
  std::vector<int> measured_orbits_;  ///< Of each session: what `instruments_` is of.
  std::vector<JointInformation> instruments_;
  std::optional<ProbedRuns> probes_;  ///< Of the first instruments.
  PlanScope scope_;
};

}  // namespace

bool can_study_plan(const MicroscopeCampaign& campaign) {
  try {
    (void)calibration_of(with_joint(campaign));
    return campaign.scenario.noise.scale > 0.0;
  } catch (const ConfigError&) {
    return false;
  }
}

std::unique_ptr<PlanStudy> study_plan(const MicroscopeCampaign& campaign) {
  if (campaign.scenario.noise.scale == 0.0) {
    throw ConfigError("noise.scale", "0", "must be > 0: standard errors are those of noise");
  }
  return std::make_unique<JointStudy>(campaign);
}

std::vector<std::size_t> undetermined_by(const Eigen::MatrixXd& information) {
  // Each unknown in units of what it would be known to if all others were known.
  const Eigen::VectorXd unit = information.diagonal().unaryExpr(
      [](double diagonal) { return diagonal > 0.0 ? 1.0 / std::sqrt(diagonal) : 1.0; });
  const Eigen::MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);  // Of rising eigenvalue.
  constexpr double eigenvalue_max = 1e-12;
  constexpr double component_min = 0.1;
  Eigen::VectorXd squares = solver.eigenvectors().col(0).cwiseAbs2();
  for (Eigen::Index i = 1; i < scaled.rows() && solver.eigenvalues()[i] <= eigenvalue_max; ++i) {
    squares += solver.eigenvectors().col(i).cwiseAbs2();
  }
  std::vector<std::size_t> unknowns;
  for (Eigen::Index i = 0; i < scaled.rows(); ++i) {
    if (squares[i] <= component_min * component_min) continue;
    unknowns.push_back(static_cast<std::size_t>(i));
  }
  return unknowns;
}

}  // namespace proofmass
