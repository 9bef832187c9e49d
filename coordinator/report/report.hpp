#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/stated_requirement.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/statistics.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// Everything that `proofmass report` prints: summary and all tables, computed from the results in
/// the file. Lines have at most 80 characters.
/// @throws StoreError if results, given-up runs or stop checks are not what was stored; see
///         check_digest().
[[nodiscard]] std::string report_text(const Store& store, const Campaign& campaign,
                                      Paint paint = Paint::no);

/// Name, seed if it is known, and how many runs ended how.
/// @param num_runs  Runs wanted.
/// @param digest    Of the results; see Digest.
/// @param check     A line says so if the digest could not be checked.
[[nodiscard]] std::string summary_text(std::string_view name, std::optional<std::uint64_t> seed,
                                       std::uint64_t num_runs, const CampaignStatistics& statistics,
                                       std::string_view digest,
                                       DigestCheck check = DigestCheck::holds);

/// Campaign::note() under its name, as lines of summary_text(); empty if there is none.
[[nodiscard]] std::string note_text(const Campaign& campaign);

/// The line that names the runs that were given up; empty if there are none.
/// @param given_up  Ascending.
[[nodiscard]] std::string given_up_text(std::span<const RunRange> given_up,
                                        Paint paint = Paint::no);

/// What report_text() tells, but for the stop rule, and the answers to requirements, as JSON for
/// programs, with the verification matrix: in full precision and SI units.
/// coordinator/cli/README.md lists the keys.
/// @param stated  Of the matrix; see matrix_requirements().
/// @throws StoreError as report_text() does; ConfigError as parse_requirement().
[[nodiscard]] std::string report_json(const Store& store, const Campaign& campaign,
                                      std::span<const RequirementAnswer> answers,
                                      std::span<const StatedRequirement> stated);

}  // namespace proofmass::coordinator
