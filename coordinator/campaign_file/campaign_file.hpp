#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/report/stated_requirement.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {

namespace detail {

/// A file cannot be opened, is no regular file, or is too large; the text is the reason alone.
class UnreadableFile : public Error {
 public:
  using Error::Error;
};

/// What is done with a pipe or a device, which may never end.
enum class Pipes : std::uint8_t {
  refused,
  accepted,  ///< For a file that a user names: `<(make_campaign)`.
};

/// All bytes of a file.
/// @throws UnreadableFile
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, std::size_t size_max,
                                         Pipes pipes);

/// read_text_file() of a file that a user names.
/// @throws DefinitionError `file: reason`.
[[nodiscard]] std::string read_definition_text(const std::filesystem::path& file,
                                               std::size_t size_max, Pipes pipes);

}  // namespace detail

/// What a command line changes in a campaign file.
struct Overrides {
  std::vector<std::string> assignments = {};   ///< `estimation.correction=second_order`.
  std::optional<std::uint64_t> num_runs = {};  ///< At most num_runs_max.
  std::optional<std::uint64_t> seed = {};      ///< At most seed_max.
};

/// Largest campaign file that is read; those with every key have some 12 kB.
inline constexpr std::uintmax_t campaign_file_size_max = std::uintmax_t{1} << 20;
/// Largest file of data that a campaign file may name.
inline constexpr std::uintmax_t data_file_size_max = std::uintmax_t{64} << 20;

/// Reads, completes with the nominal values and checks a campaign file and its data files, whose
/// paths are relative to it.
///
/// A key of the file replaces the nominal value of its field; the model says which values are
/// nominal, and which keys apply before others. `campaign.model` says which of models() it is of,
/// by its name or version; the first one if it is left out.
///
/// @throws DefinitionError naming file, line, field, value and rule, or a key that is overridden
///         twice.
[[nodiscard]] std::unique_ptr<Campaign> read_campaign(const std::filesystem::path& file,
                                                      const Overrides& overrides = {});

/// Model::environment_file() for a campaign file, whose data files need not exist.
/// @param physics  File that says what is not nominal; empty: nothing.
/// @throws DefinitionError or ConfigError
[[nodiscard]] EnvironmentFile environment_file(const std::filesystem::path& file,
                                               const Overrides& overrides,
                                               const std::filesystem::path& physics,
                                               const std::string& session);

/// The campaign of Model::example().
[[nodiscard]] std::unique_ptr<Campaign> example_campaign(const Model& of);

/// What keeps the runs of two campaigns from being compared or joined, a line each:
/// `seed: 1 in the database, 2 asked for`. The number of runs is no difference, nor is the name of
/// a data file whose values are the same.
[[nodiscard]] std::vector<std::string> definition_differences(const Campaign& stored,
                                                              const Campaign& wanted);

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
