#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace proofmass::test {

/// What is done with a campaign database: each is what a command of the programs does, without the
/// printing.
enum class FileUse : std::uint8_t {
  list,
  report,
  requirement,
  sensitivity,
  export_hdf5,
  compare,
  query,
  verify,
  back_up,
  run,    ///< Opened for writing as by `proofmass run`, asked for more runs, and summarised.
  serve,  ///< By a coordinator that is told to stop at once.
};

inline constexpr std::size_t num_file_uses = 11;

/// Makes three campaign databases: one that is finished, one half done after losses, crashes and
/// second results, and one whose environment and draws come from tables.
///
/// @param directory  Exists and is empty.
/// @return Their paths.
[[nodiscard]] std::vector<std::filesystem::path> make_seed_files(
    const std::filesystem::path& directory);

/// Uses a file that may hold anything. Being refused with a proofmass::Error is as good as being
/// read; any other exception is returned as text, as it would end a program without a reason.
///
/// @param pristine  Another campaign database, to compare with.
[[nodiscard]] std::string use_file(FileUse use, const std::filesystem::path& file,
                                   const std::filesystem::path& pristine);

/// The same with a file that is sound: why it was refused, as well; empty if it was not.
[[nodiscard]] std::string take_file(FileUse use, const std::filesystem::path& file,
                                    const std::filesystem::path& pristine);

}  // namespace proofmass::test
