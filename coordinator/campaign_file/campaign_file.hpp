#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What a command line changes in a campaign file.
struct Overrides {
  std::vector<std::string> assignments = {};  ///< `estimation.correction=second_order`.
  std::optional<std::uint64_t> num_runs = {};
  std::optional<std::uint64_t> seed = {};
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

/// What an environment file is to be made for.
struct EnvironmentRequest {
  std::filesystem::path physics = {};  ///< File that says what is not nominal; empty: nothing.
  std::string session = {};            ///< As in Model::environment_file().
};

/// The text of Model::environment_file() for a campaign file, whose data files need not exist.
/// @throws DefinitionError or ConfigError
[[nodiscard]] std::string environment_file(const std::filesystem::path& file,
                                           const Overrides& overrides,
                                           const EnvironmentRequest& request);

/// The campaign of Model::example().
[[nodiscard]] std::unique_ptr<Campaign> example_campaign(const Model& of);

/// What a database says of its campaign besides the definition, as text.
struct StoredIdentity {
  std::string name;
  std::string seed;
  std::string num_runs;
};

/// @throws DefinitionError if these are not of the campaign that the definition is of.
void require_identity(const Campaign& defined, const StoredIdentity& stored);

/// What keeps the runs of two campaigns from being compared or joined, a line each:
/// `seed: 1 in the database, 2 asked for`. The number of runs is no difference, nor is the name of
/// a data file whose values are the same.
[[nodiscard]] std::vector<std::string> definition_differences(const Campaign& stored,
                                                              const Campaign& wanted);

}  // namespace proofmass::coordinator
