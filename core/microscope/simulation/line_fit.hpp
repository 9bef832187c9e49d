#pragma once

#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

/// The fit of a session's record: of Session::fit_lines, with the known lines beside them.
[[nodiscard]] LineFit line_fit(const Scenario& scenario, const Session& session);

/// Fits of a session's record in which one or two of the known lines are those whose phasors are
/// wanted, for all of them in turn. Empty if the session has none.
[[nodiscard]] std::vector<LineFit> known_line_fits(const LineFit& of_session);

}  // namespace proofmass
