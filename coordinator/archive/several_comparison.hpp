#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

/// Most campaigns that `compare` takes: each is compared with the first, and has a row for each
/// parameter.
inline constexpr std::size_t num_compared_max = 64;

/// One of several campaigns: all its runs with an estimate, and how it differs from the first.
struct ComparedMember {
  std::filesystem::path file;
  std::uint64_t num_runs = 0;  ///< Wanted.
  CampaignStatistics statistics;
  std::string digest;              ///< Of the results.
  MissingEstimates missing;        ///< Runs that the statistics leave out.
  std::vector<double> objectives;  ///< Of each quantity, SI; infinite if there is none.
  /// With the first campaign as its first side; empty for the first campaign itself. The adjusted
  /// p-values are those of adjust_together().
  std::optional<CampaignComparison> comparison;
};

/// Reads campaigns and compares each with the first, as compare_campaigns().
/// @param files  At least two.
/// @throws StoreError, DefinitionError and Interrupted as read_compared() does.
[[nodiscard]] std::vector<ComparedMember> compare_several(
    std::span<const std::filesystem::path> files, const IsStopped& is_stopped);

/// Corrects the p-values of all parameters and all campaigns together, see adjusted_changes(): the
/// more campaigns are compared, the larger a change must be to be significant. What was not
/// compared is left out.
void adjust_together(std::span<ComparedMember> members);

/// What several campaigns are called in their tables.
struct MemberNames {
  std::string title;               ///< `campaign`, or the key that was varied.
  std::vector<std::string> names;  ///< Of each: `A`, or the value of the key.
  std::vector<std::string> notes;  ///< What the list of campaigns says of each beside its file.
};

/// `A` to `Z`, `AA`, `AB` and so on.
[[nodiscard]] MemberNames lettered(std::size_t count);

/// The campaigns, the keys of their definitions that differ, and tables of bias, scatter and
/// |error| with a row for each parameter and campaign. Lines have at most 80 characters but for
/// names of files and values of definitions that are longer.
[[nodiscard]] std::string comparison_text(std::span<const ComparedMember> members,
                                          const MemberNames& names, Paint paint = Paint::no);

/// A text of a key, for JSON.
using KeyText = std::pair<std::string, std::string>;

/// A comparison as JSON, complete and in SI units: of two campaigns one object, of several a list
/// of campaigns, each with its comparison with the first.
/// @param varied  Keys with their values for each campaign, which is in the list then, even of two;
///                empty if none was varied.
[[nodiscard]] std::string comparison_json(std::span<const ComparedMember> members,
                                          std::span<const std::vector<KeyText>> varied = {});

}  // namespace proofmass::coordinator
