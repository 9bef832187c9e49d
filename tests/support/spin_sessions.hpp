#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::test {

/// The paper's sessions in a frame that spins at a multiple of f_orb, of either sign. A gradient's
/// line at 2 f_orb is one at 2 f_EP there, with eccentric companions f_orb away; the Earth's
/// direction turns at f_EP, that of the Sun at f_spin; the moving mass meets the Coriolis
/// acceleration.
inline void spin_sessions(MicroscopeCampaign& campaign, double spin_in_orbits) {
  const double period_s = campaign.scenario.orbit.period_s;
  const std::vector<LineMultiple> quiet{{1, 0, 1}, {0, 0, 1}, {-1, 0, 1}, {2, 0, 1},
                                        {1, 0},    {1, 0, 2}, {3, 0, 2}};
  const std::vector<LineMultiple> shaken{{1, 0, 1},   {0, 0, 1},   {2, 0, 2},  {0, 1},  {0, 2},
                                         {2, 1, 2},   {-2, 1, -2}, {1, 1},     {-1, 1}, {3, 1, 2},
                                         {-3, 1, -2}, {1, 1, 2},   {-1, 1, -2}};
  for (Session& session : campaign.scenario.sessions) {
    session.spin_rate_rad_s = spin_in_orbits * 2.0 * std::numbers::pi / period_s;
    const auto frequency_of = [&](const LineMultiple& line) {
      return line_frequency_hz(session, line, period_s);
    };
    const auto made_positive = [&](LineMultiple line) {
      if (frequency_of(line) > 0.0) return line;
      return LineMultiple{0.0 - line.orbital, 0.0 - line.excitation, 0.0 - line.spin};
    };
    for (LineMultiple& line : session.fit_lines) {
      if (std::abs(line.orbital) == 2.0) line.spin = line.orbital;
      line = made_positive(line);
    }
    session.known_lines.clear();
    for (const LineMultiple& candidate : session.excitations.empty() ? quiet : shaken) {
      const LineMultiple line = made_positive(candidate);
      const auto is_near = [&](const LineMultiple& other) {
        return std::abs(frequency_of(line) - frequency_of(other)) < 0.11 / period_s;
      };
      if (frequency_of(line) < 0.11 / period_s) continue;
      if (std::ranges::any_of(session.fit_lines, is_near)) continue;
      if (std::ranges::none_of(session.known_lines, is_near)) session.known_lines.push_back(line);
    }
  }
}

}  // namespace proofmass::test
