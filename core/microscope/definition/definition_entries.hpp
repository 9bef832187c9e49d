#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/law_keys.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::detail {

/// A key of a campaign file, with its value as TOML.
struct Entry {
  std::string path;            ///< `estimation.transient_s`; for a session or a law the key alone.
  std::string text;            ///< `1000`.
  std::string comment;         ///< Meaning and rule; may be empty.
  DefinitionValue value = {};  ///< What the text says.
};

/// Everything outside sessions and dispersions, in file order.
[[nodiscard]] std::vector<Entry> scenario_entries(const MicroscopeCampaign& campaign);

/// All keys of one session but its excitations.
[[nodiscard]] std::vector<Entry> session_entries(const Session& session);

/// All keys of one excitation.
[[nodiscard]] std::vector<Entry> excitation_entries(const Excitation& excitation);

/// `{ kind = "drag_free", axis = "x", ... }`.
[[nodiscard]] std::string excitation_text(const Excitation& excitation);

/// True if the group's laws are the nominal ones and texts leave them out: those that came after
/// the first release, so that the text of a campaign remains the one that it was stored with.
[[nodiscard]] bool is_left_out(const MicroscopeCampaign& campaign, const DrawGroup& group);

/// The law and its own keys.
[[nodiscard]] std::vector<Entry> dispersion_entries(const Dispersion& dispersion);

/// `{ law = "uniform", minimum = -0.01, maximum = 0.01 }`.
[[nodiscard]] std::string dispersion_text(const Dispersion& dispersion);

[[nodiscard]] std::string_view name_of(Law law);

/// The field of a key, null unless the key has a text.
[[nodiscard]] std::string* text_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null unless the key has a list of numbers.
[[nodiscard]] std::vector<double>* numbers_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null unless the key has a list of texts.
[[nodiscard]] std::vector<std::string>* texts_at(Dispersion& dispersion, std::string_view key);

}  // namespace proofmass::detail
