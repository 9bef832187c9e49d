#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/definition.hpp"
#include "core/error.hpp"

namespace proofmass {

class Document;

/// A definition, a data file that it names, or an override cannot be used. Reads
/// `campaign.toml:12: estimation.transient_s = -5 (must be >= 0)`; where several things are wrong,
/// it is the first in the text.
class DefinitionError : public Error {
 public:
  using Error::Error;
};

/// Whether a definition has the values of its `table` laws.
enum class TableColumns : std::uint8_t {
  included,
  left_out,  ///< They come with the runs.
};

/// The campaign that a document defines, without the values of its data files. What is absent keeps
/// its nominal value; what is wrong is remembered by the document.
[[nodiscard]] Campaign read_definition(Document& document);

/// The campaign of a text and of data that have been read before; opens no file.
///
/// @param name               For messages: where the text is from.
/// @param text               TOML; what it leaves out keeps its nominal value.
/// @param environment_table  Rows of the environment file; empty if harmonic.
/// @param table_columns      As in Campaign::table_columns.
/// @throws DefinitionError if the text or the data are not those of a valid campaign.
[[nodiscard]] Campaign parse_campaign(const std::string& name, std::string_view text,
                                      EnvironmentTable environment_table,
                                      std::vector<std::vector<double>> table_columns);

/// The definition of a valid campaign.
[[nodiscard]] Definition definition_of(const Campaign& campaign,
                                       TableColumns columns = TableColumns::included);

/// The campaign of a definition that another program sent.
///
/// @param definition  Anything at all. Time and memory are in proportion to its size.
/// @throws DefinitionError unless it is, to the byte, the definition of a valid campaign.
[[nodiscard]] Campaign campaign_of(Definition definition,
                                   TableColumns columns = TableColumns::included);

/// Every value of a campaign as TOML, in a fixed order and with the shortest numbers that read back
/// to the same bits. Rows of data files are not in it.
[[nodiscard]] std::string canonical_definition(const Campaign& campaign);

/// The same for people: each field with its meaning and rule, dispersions by group.
[[nodiscard]] std::string commented_campaign(const Campaign& campaign);

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

}  // namespace proofmass
