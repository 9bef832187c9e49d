#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/store/records.hpp"

namespace proofmass::coordinator {

// Commands about databases that exist. All return an ExitCode, and throw StoreError or ArchiveError
// if a file cannot be read or written.

/// How a command prints what it found.
enum class AnswerFormat : std::uint8_t { table, json };

/// What `proofmass verify` was asked for.
struct VerifyCommandOptions {
  std::filesystem::path database;
  double fraction = 0.01;  ///< Of the runs, simulated again; in [0, 1].
};

/// Prints each check; exit_cannot_be_done if one fails.
[[nodiscard]] int verify_database(const VerifyCommandOptions& options);

/// What `proofmass compare` was asked for.
struct CompareOptions {
  std::filesystem::path first;
  std::filesystem::path second;
  AnswerFormat format = AnswerFormat::table;
};

/// Prints what two campaigns differ in.
[[nodiscard]] int compare_databases(const CompareOptions& options);

/// What `proofmass list` was asked for.
struct ListOptions {
  std::vector<std::filesystem::path> places;  ///< Files and directories; empty for this one.
  AnswerFormat format = AnswerFormat::table;
};

/// Prints the campaigns of files and directories.
[[nodiscard]] int list_databases(const ListOptions& options);

/// Copies a database, also while it is written.
[[nodiscard]] int back_up_database(const std::filesystem::path& database,
                                   const std::filesystem::path& destination);

/// What is to become of a database's tags.
enum class TagAction : std::uint8_t { print, add, remove };

struct TagOptions {
  std::filesystem::path database;
  TagAction action = TagAction::print;
  std::vector<std::string> tags;
};

/// Adds or removes tags, or prints them, one a line.
/// @throws UsageError unless there are tags exactly if there is something to do with them;
///         InvalidArgument for a tag that breaks the rules.
[[nodiscard]] int tag_database(const TagOptions& options);

struct NoteOptions {
  std::filesystem::path database;
  std::optional<std::string> text;  ///< Prints the notes if there is none.
};

/// Adds a note, or prints all, each after its time.
/// @throws InvalidArgument for a note that breaks the rules.
[[nodiscard]] int note_database(const NoteOptions& options);

}  // namespace proofmass::coordinator
