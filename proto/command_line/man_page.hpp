#pragma once

#include <string>
#include <vector>

#include "proto/command_line/described_program.hpp"

namespace proofmass::wire {

/// The manual page of a program in the language of man(7), section 1, for all its commands.
///
/// @param version   `proofmass 0.1.0`, for the foot of the page.
/// @param see_also  Names of other programs with a page.
[[nodiscard]] std::string man_page(const DescribedCommand& program, const std::string& version,
                                   const std::vector<std::string>& see_also);

}  // namespace proofmass::wire
