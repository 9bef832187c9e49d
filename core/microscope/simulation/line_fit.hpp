#pragma once

#include <cstddef>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

/// The fit of a session's record: of Session::fit_lines, with the known lines beside them. A test
/// has none.
[[nodiscard]] LineFit line_fit(const Scenario& scenario, const Session& session);

/// Fits of a session's record in which one or two of the known lines are those whose phasors are
/// wanted, for all of them in turn. Empty if the session has none.
[[nodiscard]] std::vector<LineFit> known_line_fits(const LineFit& of_session);

/// One or two lines that a method asks for, and their fit.
struct LineGroup {
  LineFit fit;
  LineSignals signals;
  std::vector<std::size_t> lines;  ///< Of fit.fit_hz: their indices in RecordNeeds::lines.
};

/// The lines that a method asks for beside the session's own. Two that follow one another with the
/// same signals share a fit.
[[nodiscard]] std::vector<LineGroup> line_groups(const Scenario& scenario, const Session& session,
                                                 const RecordNeeds& needs);

}  // namespace proofmass
