#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/microscope/session/session.hpp"

namespace proofmass {

/// Spelling of the enumerators in campaign files and messages, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(Axis);
[[nodiscard]] std::span<const std::string_view> names_of(ExcitationKind);
[[nodiscard]] std::span<const std::string_view> names_of(MassMotion);
[[nodiscard]] std::span<const std::string_view> names_of(DragFreeSource);
[[nodiscard]] std::span<const std::string_view> names_of(SessionTarget);

/// Name of the key that holds an excitation's amplitude, with its unit: `amplitude_rad`.
[[nodiscard]] std::string_view amplitude_key(ExcitationKind kind);

/// `[2, 1]`: the line at 2 f_orb + f; `[1, 0, 1]`: that at f_orb + f_spin.
[[nodiscard]] std::string text_of(const LineMultiple& line);

}  // namespace proofmass
