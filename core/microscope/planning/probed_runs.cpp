#include "core/microscope/planning/probed_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

#include "core/math/instruction_set.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/simulation/run_health.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// Orbits of a short session, if its lines can be told apart in so few.
constexpr int num_short_orbits = 3;

/// Whether the session's record tells all lines apart that are fitted in it, by the method or as
/// the session's own, and is long against the transient.
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
  for (const LineMultiple& line : session.fit_lines) add(line);
  for (const LineMultiple& line : session.known_lines) add(line);
  if (is_test(session)) lines_hz.push_back(test_frequency_hz(session, scenario.orbit.period_s));
  std::ranges::sort(lines_hz);
  for (std::size_t i = 1; i < lines_hz.size(); ++i) {
    const double difference = (lines_hz[i] - lines_hz[i - 1]) * duration_s;
    const bool is_same = difference < 1e-6;  // A neighbour may be one of the lines.
    if (!is_same && difference < 1.0) return false;
  }
  return true;
}

/// What the squares of a record would have been, had it been longer.
void lengthen(LoopMonitor<double>& monitor, double factor) {
  monitor.quadratic.squares *= factor;
  monitor.common_square.squares *= factor;
  for (BlockSteps<double>& steps : monitor.sensor_square) steps.squares *= factor;
}

/// What a run is lost by.
/// @param record  That `finding` is of.
PlanLoss plan_loss(const Scenario& scenario, const HealthRecord& record,
                   const HealthFinding& finding) {
  PlanLoss loss{.cause = std::string(name_of(finding.loss.cause)), .session = {}, .detail = {}};
  if (finding.loss.cause != LossCause::saturation) {
    loss.session = name_of(finding.loss.session);
    loss.detail = fmt::format("may move the estimate of {} beyond its objective", loss.session);
    return loss;
  }
  const double range_m_s2 = scenario.sensor.range_m_s2;
  const auto is_beyond = [range_m_s2](const SessionHealth& health) {
    return !(health.acceleration_m_s2 <= range_m_s2);
  };
  const auto first = std::ranges::find_if(record, is_beyond);
  const auto i = static_cast<std::size_t>(first - record.begin());
  loss.session = scenario.sessions[std::min(i, record.size() - 1)].name;
  loss.detail = fmt::format("a sensor measures more than sensor.range_m_s2 = {} in session {}",
                            range_m_s2, loss.session);
  return loss;
}

void add_loss(PlanLoss loss, std::vector<PlanLoss>& losses) {
  auto same = std::ranges::find(losses, loss.detail, &PlanLoss::detail);
  if (same == losses.end()) same = losses.insert(same, std::move(loss));
  ++same->num_runs;
}

/// @param shifts  Of a run.
void add_warning(const std::vector<Shift>& shifts, PlanWarnings& warnings) {
  const auto largest = std::ranges::max_element(shifts, {}, &Shift::part);
  if (largest == shifts.end() || largest->part < warned_part) return;
  ++warnings.num_runs;
  if (largest->part <= warnings.largest_part) return;
  warnings.largest_part = largest->part;
  warnings.quantity = index(largest->parameter);
  warnings.effect = name_of(largest->effect);
}

/// Level of the budget that all runs have in common. Noise differs between them, so that it is as
/// small in a fit of all together as in one run with sessions that are so many times as long.
/// @return 0 without a run, or if no session tells it.
double common_level_m_s2(const MicroscopeCampaign& campaign,
                         const std::vector<const RunRecord*>& runs) {
  if (runs.empty()) return 0.0;
  const Scenario& scenario = campaign.scenario;
  RunRecord all = *runs.front();
  for (std::size_t i = 0; i < all.health.size(); ++i) {
    std::vector<double>& products = all.phasors[i].test_products;
    std::ranges::fill(products, 0.0);
    auto& residual = all.health[i].monitor.residual;
    residual = {};
    for (const RunRecord* const run : runs) {
      std::ranges::transform(products, run->phasors[i].test_products, products.begin(),
                             std::plus<>());
      for (std::size_t axis = 0; axis < residual.size(); ++axis) {
        for (std::size_t part = 0; part < residual[axis].size(); ++part) {
          residual[axis][part] +=
              run->health[i].monitor.residual[axis][part] / static_cast<double>(runs.size());
        }
      }
    }
  }
  const HealthFinding finding = judge_health(scenario, ShiftBounds(scenario, campaign.dispersions),
                                             all.health, all.phasors, all.truth, {});
  return scenario.has_tests() ? finding.test_residual_m_s2 : finding.health.residual_m_s2;
}

}  // namespace

MicroscopeCampaign short_campaign(MicroscopeCampaign campaign) {
  for (Session& session : campaign.scenario.sessions) {
    const int num_orbits = session.num_orbits;
    session.num_orbits = std::min(num_orbits, num_short_orbits);
    while (session.num_orbits < num_orbits && !tells_lines_apart(campaign.scenario, session)) {
      ++session.num_orbits;
    }
  }
  return campaign;
}

ProbedRuns::ProbedRuns(const MicroscopeCampaign& campaign, const std::vector<RunIndex>& runs)
    : dispersions_(campaign.dispersions) {
  // One by one a run takes as long as a batch, a second or more.
  constexpr std::size_t one_by_one_max = 4;
  const std::size_t num_max = campaign.scenario.has_plain_loops() ? batch_lanes : one_by_one_max;
  std::vector<RunRequest> requests;
  for (std::size_t i = 0; i < std::min(runs.size(), num_max); ++i) {
    requests.push_back({runs[i], campaign.table_values(runs[i])});
  }
  const MicroscopeCampaign brief = short_campaign(campaign);
  for (const Session& session : brief.scenario.sessions) num_orbits_.push_back(session.num_orbits);
  const RunPlan plan(brief, joint_method);
  std::vector<const RunRecord*> held;
  std::vector<double> fits(2 + 2 * num_orbits_.size());  // Sums of RunResult::fit.
  probes_.reserve(requests.size());
  for (RunRecord& record : plan.record_batch(requests, best_instruction_set())) {
    const RunResult result = plan.estimate(record);
    Probe& probe = probes_.emplace_back();
    probe.record = std::move(record);
    probe.has_converged = result.status != RunStatus::not_converged;
    // Estimates that still move fit nothing.
    if (probe.has_converged && !result.fit.empty()) {
      probe.is_misfit = is_beyond_chance(result.fit[0], result.fit[1]);
      for (std::size_t i = 0; i < result.fit.size(); ++i) fits[i] += result.fit[i];
    }
    if (result.status != RunStatus::lost) held.push_back(&probes_.back().record);
  }
  do_fit_together_ = !is_beyond_chance(fits[0], fits[1]);
  for (std::size_t i = 0; i < num_orbits_.size(); ++i) {
    if (!is_beyond_chance(fits[2 + 2 * i], fits[3 + 2 * i])) continue;
    misfit_sessions_.push_back(brief.scenario.sessions[i].name);
  }
  level_m_s2_ = common_level_m_s2(brief, held);
}

std::size_t ProbedRuns::num_misfits() const {
  const auto count = std::ranges::count_if(probes_, &Probe::is_misfit);
  return count == 0 && !do_fit_together_ ? probes_.size() : static_cast<std::size_t>(count);
}

void ProbedRuns::judge(const Scenario& scenario, const std::vector<ParameterArray>& errors,
                       PlanBound& bound) const {
  const ShiftBounds bounds(scenario, dispersions_);
  for (std::size_t k = 0; k < probes_.size(); ++k) {
    const RunRecord& probe = probes_[k].record;
    if (!probes_[k].has_converged) {
      add_loss({.cause = "not_converged",
                .session = {},
                .detail = fmt::format("estimates still move after estimation.num_rounds_max = {}",
                                      scenario.estimation.num_rounds_max)},
               bound.losses);
      continue;
    }
    HealthRecord record = probe.health;
    for (std::size_t i = 0; i < record.size(); ++i) {
      const double num_orbits = scenario.sessions[i].num_orbits;
      lengthen(record[i].monitor, num_orbits / num_orbits_[i]);
    }
    const bool are_usable = std::ranges::all_of(errors[k], is_in_range);
    const auto usable = are_usable ? std::span<const double>(errors[k]) : std::span<const double>();
    const HealthFinding finding =
        judge_health(scenario, bounds, record, probe.phasors, probe.truth, usable);
    if (finding.loss.cause == LossCause::none) {
      add_warning(bounds.of(finding.health, probe.truth, usable), bound.warnings);
    } else {
      add_loss(plan_loss(scenario, record, finding), bound.losses);
    }
  }
  std::ranges::stable_sort(bound.losses, std::greater<>(), &PlanLoss::num_runs);
}

}  // namespace proofmass
