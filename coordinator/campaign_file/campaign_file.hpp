#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

/// A campaign file, a data file that it names, or an override cannot be used. Reads
/// `campaign.toml:12: estimation.transient_s = -5 (must be >= 0)`; where several things are wrong,
/// it is the first in the file.
class CampaignFileError : public Error {
 public:
  using Error::Error;
};

/// What a command line changes in a campaign file.
struct Overrides {
  std::vector<std::string> assignments =
      {};  ///< `estimation.correction=second_order`; the last wins.
  std::optional<std::uint64_t> num_runs = {};
  std::optional<std::uint64_t> seed = {};
};

/// Largest campaign file that is read; the paper's campaign has 12 kB.
inline constexpr std::uintmax_t campaign_file_size_max = std::uintmax_t{1} << 20;
/// Largest environment or table file that is read.
inline constexpr std::uintmax_t data_file_size_max = std::uintmax_t{64} << 20;

/// Reads, completes with the nominal values and checks a campaign file and its data files, whose
/// paths are relative to it.
///
/// A key of the file replaces the nominal value of its field; without any `[[session]]` the
/// sessions are the paper's. `noise.preset` applies before the other keys of noise, the law of a
/// dispersion group before those of its elements.
///
/// @throws CampaignFileError naming file, line, field, value and rule.
[[nodiscard]] Campaign read_campaign(const std::filesystem::path& file,
                                     const Overrides& overrides = {});

/// The campaign of a canonical definition and of data that have been read before; opens no file.
///
/// @param definition         Text made by canonical_definition().
/// @param environment_table  Rows of the environment file; empty if harmonic.
/// @param table_columns      As in Campaign::table_columns.
/// @throws CampaignFileError if the definition or the data are not those of a valid campaign.
[[nodiscard]] Campaign parse_stored_campaign(std::string_view definition,
                                             EnvironmentTable environment_table,
                                             std::vector<std::vector<double>> table_columns);

/// What a database says of its campaign besides the definition, as text.
struct StoredIdentity {
  std::string name;
  std::string seed;
  std::string num_runs;
};

/// @throws CampaignFileError if these are not of the campaign that the definition is of.
void require_identity(const Campaign& defined, const StoredIdentity& stored);

/// Every value of a campaign as TOML, in a fixed order and with the shortest numbers that read back
/// to the same bits. Rows of data files are not in it.
[[nodiscard]] std::string canonical_definition(const Campaign& campaign);

/// The same for people: each field with its meaning and rule, dispersions by group.
[[nodiscard]] std::string commented_campaign(const Campaign& campaign);

/// The campaign of [Hardy2013] section 5: 100 draws, the corrections of the paper.
[[nodiscard]] Campaign hardy2013_campaign();

/// A value that two campaigns do not share.
struct DefinitionDifference {
  std::string field;   ///< `noise.scale`.
  std::string first;   ///< As in a campaign file, or what is to be said about a file's rows.
  std::string second;  ///< The same.
};

/// Everything but the number of runs that two campaigns do not share, in the order of a campaign
/// file. The name of a data file whose values are the same is no difference.
[[nodiscard]] std::vector<DefinitionDifference> compare_definitions(const Campaign& first,
                                                                    const Campaign& second);

/// What keeps the runs of two campaigns from being compared or joined, a line each:
/// `seed: 1 in the database, 2 asked for`. The number of runs is no difference, nor is the name of
/// a data file whose values are the same.
[[nodiscard]] std::vector<std::string> definition_differences(const Campaign& stored,
                                                              const Campaign& wanted);

}  // namespace proofmass::coordinator
