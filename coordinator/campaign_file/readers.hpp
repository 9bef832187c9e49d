#pragma once

#include <string>
#include <vector>

#include "coordinator/campaign_file/document.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator::detail {

// Each asks the document for the keys of its part and completes what is absent with the nominal
// values. What is wrong is remembered by the document, and found by Document::check().

/// The whole definition; `environment_table` and `table_columns` stay empty.
[[nodiscard]] Campaign read_definition(Document& document);

/// Numbers and choices of the scenario, all but its sessions.
void read_scenario(Document& document, Scenario& scenario);

/// The list `session`, or the paper's sessions if the file has none.
[[nodiscard]] std::vector<Session> read_sessions(Document& document);

/// Laws of `[dispersion.<group>]` and, over them, of `[dispersion.<group>.<element>]`.
[[nodiscard]] DispersionSet read_dispersions(Document& document);

}  // namespace proofmass::coordinator::detail
