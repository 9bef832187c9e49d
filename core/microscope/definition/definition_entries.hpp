#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/definition/entry.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::detail {

/// Everything outside sessions and dispersions, in file order.
[[nodiscard]] std::vector<Entry> scenario_entries(const MicroscopeCampaign& campaign);

/// All keys of one session but its excitations.
[[nodiscard]] std::vector<Entry> session_entries(const Session& session);

/// `loop` to `delay_samples`.
[[nodiscard]] std::vector<Entry> controller_entries(const ControllerConfig& controller);

/// All keys of one excitation.
[[nodiscard]] std::vector<Entry> excitation_entries(const Excitation& excitation);

/// `{ kind = "drag_free", axis = "x", ... }`.
[[nodiscard]] std::string excitation_text(const Excitation& excitation);

/// True if the group's laws are the nominal ones and texts leave them out: those that came after
/// the first release, so that the text of a campaign remains the one that it was stored with.
[[nodiscard]] bool is_left_out(const MicroscopeCampaign& campaign, const DrawGroup& group);

/// `{ law = "uniform", minimum = -0.01, maximum = 0.01 }`.
[[nodiscard]] std::string dispersion_text(const Dispersion& dispersion);

}  // namespace proofmass::detail
