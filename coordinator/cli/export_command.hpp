#pragma once

#include <cstdint>
#include <filesystem>

#include "coordinator/archive/drawn_columns.hpp"

namespace proofmass::coordinator {

enum class ExportFormat : std::uint8_t { csv, json, hdf5 };

/// What `proofmass export` was asked for.
struct ExportOptions {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::csv;
  std::filesystem::path output;  ///< Empty or `-` for standard output.
  bool is_forced = false;        ///< Replaces an existing file.
  DrawColumns draws = DrawColumns::left_out;
};

/// Writes all results of a database to a file or to standard output.
/// @return An ExitCode.
/// @throws UsageError if the file exists and must not be replaced, or if a format needs one;
///         StoreError, ArchiveError, DefinitionError.
[[nodiscard]] int export_results(const ExportOptions& options);

}  // namespace proofmass::coordinator
