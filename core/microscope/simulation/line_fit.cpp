#include "core/microscope/simulation/line_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/microscope/simulation/session_signals.hpp"

namespace proofmass {

LineFit line_fit(const Scenario& scenario, const Session& session) {
  const double period_s = scenario.simulation.sample_period_s;
  LineFit fit;
  fit.num_samples = static_cast<std::size_t>(num_record_samples(scenario, session));
  fit.num_dropped = static_cast<std::size_t>(std::ceil(scenario.estimation.transient_s / period_s));
  fit.sample_period_s = period_s;
  if (is_test(session)) return fit;
  for (const LineMultiple& line : session.fit_lines) {
    fit.fit_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
  }
  for (const LineMultiple& line : session.known_lines) {
    fit.known_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
  }
  fit.filter = fit_lines_filter(session, scenario.estimation, scenario.orbit.period_s, period_s);
  return fit;
}

std::vector<LineFit> known_line_fits(const LineFit& of_session) {
  std::vector<LineFit> fits;
  const std::vector<double>& known_hz = of_session.known_hz;
  for (std::size_t first = 0; first < known_hz.size(); first += num_fit_lines_max) {
    LineFit fit = of_session;
    fit.fit_hz.clear();
    fit.known_hz = of_session.fit_hz;
    for (std::size_t i = 0; i < known_hz.size(); ++i) {
      const bool is_wanted = i >= first && i < first + num_fit_lines_max;
      (is_wanted ? fit.fit_hz : fit.known_hz).push_back(known_hz[i]);
    }
    fits.push_back(std::move(fit));
  }
  return fits;
}

namespace {

/// Frequencies of all lines that are wanted, of the level, then of those neighbours that the record
/// can tell from the lines before them.
std::vector<double> frequencies_of(const RecordNeeds& needs, const Session& session,
                                   double orbit_period_s) {
  const double resolution_hz = 0.99 / (session.num_orbits * orbit_period_s);
  std::vector<double> all_hz;
  for (const WantedLine& wanted : needs.lines) {
    all_hz.push_back(line_frequency_hz(session, wanted.line, orbit_period_s));
  }
  // A hundredth of a turn in the record: a level and a drift. The mean of a record with a strong
  // line, which is removed before, is not the level beside that line.
  all_hz.push_back(0.01 / (session.num_orbits * orbit_period_s));
  for (const LineMultiple& neighbour : needs.neighbours) {
    const double frequency_hz = line_frequency_hz(session, neighbour, orbit_period_s);
    const auto is_close = [&](double other_hz) {
      return std::abs(other_hz - frequency_hz) < resolution_hz;
    };
    if (frequency_hz < resolution_hz || std::ranges::any_of(all_hz, is_close)) continue;
    all_hz.push_back(frequency_hz);
  }
  return all_hz;
}

}  // namespace

std::vector<LineGroup> line_groups(const Scenario& scenario, const Session& session,
                                   const RecordNeeds& needs) {
  std::vector<LineGroup> groups;
  if (needs.lines.empty()) return groups;
  const double period_s = scenario.simulation.sample_period_s;
  const std::vector<double> all_hz = frequencies_of(needs, session, scenario.orbit.period_s);
  const BandPass filter =
      further_lines_filter(needs, session, scenario.estimation, scenario.orbit.period_s, period_s);
  for (std::size_t i = 0; i < needs.lines.size();) {
    LineGroup group{line_fit(scenario, session), needs.lines[i].signals, {i}};
    if (i + 1 < needs.lines.size() && needs.lines[i + 1].signals == group.signals) {
      group.lines.push_back(i + 1);
    }
    group.fit.fit_hz.clear();
    group.fit.known_hz.clear();
    for (std::size_t k = 0; k < all_hz.size(); ++k) {
      const bool is_of_group = k >= i && k < i + group.lines.size();
      (is_of_group ? group.fit.fit_hz : group.fit.known_hz).push_back(all_hz[k]);
    }
    group.fit.filter = filter;
    i += group.lines.size();
    groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace proofmass
