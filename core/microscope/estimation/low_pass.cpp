#include "core/microscope/estimation/low_pass.hpp"

#include <algorithm>

namespace proofmass {

BandPass further_lines_filter(const RecordNeeds& needs, const Session& session,
                              const EstimationConfig& config, double orbit_period_s,
                              double sample_period_s) {
  double highest_hz = 0.0;
  const auto add = [&](const LineMultiple& line) {
    highest_hz = std::max(highest_hz, line_frequency_hz(session, line, orbit_period_s));
  };
  for (const WantedLine& wanted : needs.lines) add(wanted.line);
  for (const LineMultiple& neighbour : needs.neighbours) add(neighbour);
  const double corner_hz = std::min(config.band_ratio * highest_hz, 0.25 / sample_period_s);
  return {no_filter.high_pass, butterworth_low_pass(corner_hz, sample_period_s)};
}

}  // namespace proofmass
