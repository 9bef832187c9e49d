#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace proofmass {

/// Numbers of a data file that a definition names and that all runs share.
struct DataTable {
  std::string key;  ///< Of the definition, the one that names the file: `environment.file`.
  std::uint32_t num_columns = 1;
  std::vector<double> values =
      {};  ///< Row by row, shape [rows, num_columns]; units as in the file.

  bool operator==(const DataTable&) const = default;
};

/// All that the runs of a campaign follow from, as it travels from program to program: nobody on
/// the way needs to know what it means.
struct Definition {
  std::string text;  ///< TOML in canonical form, the one that canonical_definition() writes.
  std::vector<DataTable> tables = {};
  /// Values of which each run has one of its own, a column for each `table` law, in their order.
  /// Workers get them with the runs instead.
  std::vector<std::vector<double>> table_columns = {};

  bool operator==(const Definition&) const = default;
};

/// Most bytes of a definition's text. Every campaign that can be read from a text fits.
inline constexpr std::size_t definition_text_size_max = std::size_t{1} << 20;

}  // namespace proofmass
