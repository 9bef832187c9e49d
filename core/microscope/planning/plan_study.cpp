#include "core/microscope/planning/plan_study.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/error.hpp"
#include "core/math/instruction_set.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// Drawn instruments that a bound is the mean over. The standard error of a_c11Δx scatters by 45 %
/// from one to another.
constexpr std::uint64_t num_instruments_max = 256;

/// Orbits in which a session's lines are measured, if they can be told apart in so few.
constexpr int num_measured_orbits = 3;

EstimationMethod method_named(std::string_view name) {
  const auto methods = estimation_methods();
  const auto found = std::ranges::find(methods, name, &EstimationMethodInfo::name);
  return static_cast<EstimationMethod>(found - methods.begin() + 1);
}

/// Whether the session's record tells all lines apart that the method fits in it, and is long
/// against the transient.
bool tells_lines_apart(const Scenario& scenario, const Session& session) {
  const double duration_s = session.num_orbits * scenario.orbit.period_s;
  if (duration_s < 4.0 * scenario.estimation.transient_s) return false;
  const RecordNeeds needs = joint_needs(session);
  std::vector<double> lines_hz{0.0};
  const auto add = [&](const LineMultiple& line) {
    lines_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
  };
  for (const WantedLine& wanted : needs.lines) add(wanted.line);
  for (const LineMultiple& neighbour : needs.neighbours) add(neighbour);
  std::ranges::sort(lines_hz);
  for (std::size_t i = 1; i < lines_hz.size(); ++i) {
    const double difference = (lines_hz[i] - lines_hz[i - 1]) * duration_s;
    const bool is_same = difference < 1e-6;  // A neighbour may be one of the lines.
    if (!is_same && difference < 1.0) return false;
  }
  return true;
}

/// The session with as few orbits as leave its lines what they are, and nothing that other methods
/// record.
Session measured_session(const Scenario& scenario, Session session) {
  const int num_orbits = session.num_orbits;
  session.num_orbits = std::min(num_orbits, num_measured_orbits);
  while (session.num_orbits < num_orbits && !tells_lines_apart(scenario, session)) {
    ++session.num_orbits;
  }
  session.target = SessionTarget::no_target;
  session.fit_lines = {{2.0}};
  session.known_lines.clear();
  return session;
}

/// The campaign with short sessions, without noise and without the errors of instruments, which
/// change the amplitudes of lines by a percent.
MicroscopeCampaign measured_campaign(MicroscopeCampaign campaign) {
  campaign.scenario.noise.scale = 0.0;
  for (Dispersion& dispersion : campaign.dispersions) {
    dispersion = {.law = Law::fixed, .file = {}, .column = {}};
  }
  for (Session& session : campaign.scenario.sessions) {
    session = measured_session(campaign.scenario, std::move(session));
  }
  return campaign;
}

class JointStudy final : public PlanStudy {
 public:
  explicit JointStudy(const MicroscopeCampaign& campaign) : campaign_(campaign) {
    campaign_.scenario.estimation.method = method_named(joint_method.name);
    campaign_.scenario.validate();
    const Scenario& scenario = campaign_.scenario;
    const MicroscopeCampaign measured = measured_campaign(campaign_);
    for (const Session& session : measured.scenario.sessions) {
      measured_s_.push_back(fitted_s(session.num_orbits));
    }
    const RunRecord record = RunPlan(measured, joint_method).record(RunIndex{0}, {});
    const DrawnMoments laws = drawn_moments(campaign_.dispersions);
    const EstimationInput input{.sessions = measured.scenario.sessions,
                                .config = scenario.estimation,
                                .objectives = scenario.objectives,
                                .noise = scenario.noise,
                                .laws = laws,
                                .orbit_period_s = scenario.orbit.period_s,
                                .sample_period_s = scenario.simulation.sample_period_s};
    add_instruments(record.phasors, input);
  }

  [[nodiscard]] std::string method() const override { return std::string(joint_method.name); }
  [[nodiscard]] std::vector<std::string> session_names() const override {
    std::vector<std::string> names;
    for (const Session& session : campaign_.scenario.sessions) names.push_back(session.name);
    return names;
  }
  [[nodiscard]] std::vector<int> num_steps() const override {
    std::vector<int> orbits;
    for (const Session& session : campaign_.scenario.sessions) orbits.push_back(session.num_orbits);
    return orbits;
  }
  [[nodiscard]] std::size_t num_instruments() const override { return instruments_.size(); }

  [[nodiscard]] PlanBound bound(std::span<const int> num_orbits) const override {
    std::vector<double> factors;
    for (std::size_t i = 0; i < num_orbits.size(); ++i) {
      factors.push_back(std::max(0.0, fitted_s(num_orbits[i])) / measured_s_[i]);
    }
    PlanBound bound{.standard_errors = std::vector<double>(num_parameters),
                    .misses = std::vector<double>(num_parameters)};
    const double part = 1.0 / static_cast<double>(instruments_.size());
    for (const JointInformation& instrument : instruments_) {
      const ParameterArray errors = instrument.standard_errors(factors);
      double misses_any = 0.0;
      for (std::size_t i = 0; i < num_parameters; ++i) {
        const double miss = 2.0 * normal_cumulative(-campaign_.scenario.objectives[i] / errors[i]);
        bound.standard_errors[i] += part * errors[i];
        bound.misses[i] += part * miss;
        misses_any += miss - misses_any * miss;
      }
      bound.misses_any += part * misses_any;
    }
    if (const std::optional<ErrorBudget> budget = campaign_.error_budget()) {
      // The mean of |x| of a normal law.
      std::vector<double> means = bound.standard_errors;
      for (double& mean : means) mean *= std::sqrt(2.0 / std::numbers::pi);
      bound.mean_budget = budget->after(means, budget->assumed_level).total;
    }
    return bound;
  }

  [[nodiscard]] std::string campaign_file(std::span<const int> num_orbits) const override {
    MicroscopeCampaign campaign = campaign_;
    for (std::size_t i = 0; i < num_orbits.size(); ++i) {
      campaign.scenario.sessions[i].num_orbits = num_orbits[i];
    }
    campaign.validate();
    return commented_campaign(campaign);
  }

 private:
  /// Record of a session that its lines are fitted to.
  [[nodiscard]] double fitted_s(int num_orbits) const {
    return num_orbits * campaign_.scenario.orbit.period_s -
           campaign_.scenario.estimation.transient_s;
  }

  void add_instruments(const RunPhasors& phasors, const EstimationInput& input) {
    // A table has values for the runs of the campaign only.
    const std::uint64_t each = campaign_.realisations;
    const std::uint64_t num_drawn =
        campaign_.table_quantities().empty()
            ? num_instruments_max
            : std::min((campaign_.num_runs + each - 1) / each, num_instruments_max);
    const double bias_m_s2 = campaign_.scenario.drag_free.bias_compensation_error_x_m_s2;
    for (std::uint64_t i = 0; i < num_drawn; ++i) {
      const RunIndex run{i * each};
      const AcceptedDraw draw = draw_instrument(campaign_, run, campaign_.table_values(run));
      if (!draw.instrument) continue;
      instruments_.emplace_back(phasors, input, true_unknowns(*draw.instrument, bias_m_s2));
    }
    const auto is_finite = [&](const JointInformation& information) {
      return std::ranges::all_of(information.standard_errors(std::vector(measured_s_.size(), 1.0)),
                                 is_in_range);
    };
    if (instruments_.empty()) throw Error("no bound: no instrument is accepted");
    if (!std::ranges::all_of(instruments_, is_finite)) {
      throw Error(
          "no bound: the sessions do not determine all parameters, or the loops are not stable");
    }
  }

  MicroscopeCampaign campaign_;
  std::vector<double> measured_s_;  ///< Of each session: what `instruments_` is of.
  std::vector<JointInformation> instruments_;
};

}  // namespace

std::unique_ptr<PlanStudy> study_plan(const MicroscopeCampaign& campaign) {
  if (campaign.scenario.noise.scale == 0.0) {
    throw ConfigError("noise.scale", "0", "must be > 0: without noise estimates have no errors");
  }
  return std::make_unique<JointStudy>(campaign);
}

}  // namespace proofmass
