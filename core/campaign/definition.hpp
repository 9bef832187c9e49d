#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.hpp"

namespace proofmass {

/// Numbers of a data file that a definition names and that all runs share.
struct DataTable {
  std::string key;  ///< Of the definition, the one that names the file: `environment.file`.
  std::uint32_t num_columns = 1;
  std::vector<double> values =
      {};  ///< Row by row, shape [rows, num_columns]; units as in the file.

  bool operator==(const DataTable&) const = default;
};

/// Data that all runs of a campaign may share and that a database keeps as a table of its own.
struct DataTableSchema {
  std::string_view key;                   ///< As DataTable::key.
  std::string_view table;                 ///< In the database: `environment_row`.
  std::string_view comment;               ///< One line, for readers of the schema.
  std::vector<std::string_view> columns;  ///< With their units: `time_s`.
};

/// All that the runs of a campaign follow from, as it travels from program to program: nobody on
/// the way needs to know what it means.
struct Definition {
  std::string text;  ///< TOML in canonical form, the one that the model writes.
  std::vector<DataTable> tables = {};
  /// Values of which each run has one of its own, a column for each `table` law, in their order.
  /// Workers get them with the runs instead.
  std::vector<std::vector<double>> table_columns = {};
  /// Version of the model; empty: the one that programs are built with.
  std::string model = {};

  bool operator==(const Definition&) const = default;
};

/// Whether a definition has the values of its `table` laws.
enum class TableColumns : std::uint8_t {
  included,
  left_out,  ///< They come with the runs.
};

/// Most bytes of a definition's text. Every campaign that can be read from a text fits.
inline constexpr std::size_t definition_text_size_max = std::size_t{1} << 20;

/// A definition, a data file that it names, or an override cannot be used. Reads
/// `campaign.toml:12: estimation.transient_s = -5 (must be >= 0)`; where several things are wrong,
/// it is the first in the text.
class DefinitionError : public Error {
 public:
  using Error::Error;
};

/// A value of a campaign file: a whole number, another number, or a text. A list is a text too, as
/// it stands in the file.
using DefinitionValue = std::variant<std::int64_t, double, std::string>;

struct DefinitionItem {
  std::string key;  ///< `estimation.transient_s`, `session[3].excitations[0].axis`,
                    ///< `dispersion.offcentring_m.x.law`.
  DefinitionValue value;
};

/// A value that two campaigns do not share.
struct DefinitionDifference {
  std::string field;   ///< `noise.scale`.
  std::string first;   ///< As in a campaign file, or what is to be said about a file's rows.
  std::string second;  ///< As in `first`, of the other campaign.
};

}  // namespace proofmass
