#include "core/microscope/simulation/line_fit.hpp"

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
  double centre_hz = 0.0;
  for (const LineMultiple& line : session.fit_lines) {
    fit.fit_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
    centre_hz += fit.fit_hz.back() / static_cast<double>(session.fit_lines.size());
  }
  for (const LineMultiple& line : session.known_lines) {
    fit.known_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
  }
  const double ratio = scenario.estimation.band_ratio;
  fit.filter = band_pass(centre_hz / ratio, centre_hz * ratio, period_s);
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

}  // namespace proofmass
