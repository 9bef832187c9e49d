#pragma once

#include <string>
#include <vector>

#include "core/definition/document.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::detail {

// Each asks the document for the keys of its part and completes what is absent with the nominal
// values. What is wrong is remembered by the document, and found by Document::check().

/// Numbers and choices of the scenario, all but its sessions.
void read_scenario(Document& document, Scenario& scenario);

/// The list `session`, or the paper's sessions if the file has none.
[[nodiscard]] std::vector<Session> read_sessions(Document& document);

/// Laws of `[dispersion.<group>]` and, over them, of `[dispersion.<group>.<element>]`.
[[nodiscard]] DispersionSet read_dispersions(Document& document);

}  // namespace proofmass::detail
