#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "coordinator/report/stated_requirement.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// Largest requirements file that is read, and most requirements in one.
inline constexpr std::uintmax_t requirements_file_size_max = std::uintmax_t{256} << 10;
inline constexpr std::size_t num_requirements_max = 100;

/// Reads a file of requirements in TOML:
///
///     [[requirements]]
///     id = "SYS-REQ-012"
///     text = "The gain is known to 1e-3."
///     requirement = "gain < 1e-3 for 99% with 95%"
///
/// `id` has 1 to 64 bytes and is unique, `text` 1,000 at most and may be absent; see
/// parse_requirement() for the rest.
///
/// @param results  Of the campaign that they are about.
/// @throws DefinitionError naming file, line, field, value and rule.
[[nodiscard]] std::vector<StatedRequirement> read_requirements(const std::filesystem::path& file,
                                                               const ResultSchema& results);

}  // namespace proofmass::coordinator
