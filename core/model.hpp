#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/definition.hpp"
#include "core/campaign/plan_study.hpp"
#include "core/campaign/run_result.hpp"
#include "core/math/instruction_set.hpp"

namespace proofmass {

class Document;

/// A quantity that a model draws for each run.
struct DrawnQuantity {
  std::string_view name;  ///< `offcentring_m.x`, in files and in SQL.
  std::string_view unit;  ///< For people: `m`.
};

/// A file that follows from physics.
struct EnvironmentFile {
  std::string text;
  std::string note;  ///< Why it may not be right, for people; empty if nothing is known.
};

/// Reads the data files that a campaign file names.
class DataFiles {
 public:
  virtual ~DataFiles() = default;

  /// All bytes of a file.
  /// @param file  As it is named in the campaign file.
  /// @param path  Of the key that names it, for messages.
  /// @throws DefinitionError
  virtual const std::string& text_of(const std::string& file, const std::string& path) = 0;
  /// Where the file is, for messages.
  [[nodiscard]] virtual std::string name_of(const std::string& file) const = 0;
};

/// All that coordinator, workers and reports know of what a campaign simulates. Neither sees the
/// other: a model has no socket, file or worker, and what runs campaigns names no parameter.
class Model {
 public:
  virtual ~Model() = default;

  /// Name and version, [A-Za-z0-9._-]{1,128}: changes with what may change a result's bits.
  /// Coordinator and workers must agree on it; a campaign is finished by the model that began it.
  [[nodiscard]] virtual std::string_view version() const = 0;

  /// What its campaigns are for: a sentence, the first of `proofmass --help`.
  [[nodiscard]] virtual std::string_view purpose() const = 0;

  /// What the results of a stored campaign are, whatever else may be wrong with its definition.
  ///
  /// @param definition  Text of the definition. One that is none stands for that of example(), as
  ///                    an empty one does.
  /// @param version     Of the model that began the campaign: an older one recorded what its
  ///                    results were then. Under version() it is Campaign::results() of the
  ///                    definition.
  [[nodiscard]] virtual ResultSchema results_of(std::string_view definition,
                                                std::string_view version) const = 0;

  /// The data files that a definition may name and that a database keeps as tables.
  [[nodiscard]] virtual std::span<const DataTableSchema> tables() const { return {}; }

  /// What is drawn for a run, in the order of RunDraw::values.
  [[nodiscard]] virtual std::span<const DrawnQuantity> drawn() const = 0;

  /// What a run's progress counts, for people, in the plural: `orbits`.
  [[nodiscard]] virtual std::string_view step_name() const = 0;

  /// Runs that one call of Plan::simulate_batch() takes at most; fewer cost no more.
  [[nodiscard]] virtual std::size_t batch_size() const = 0;

  /// Digest of the results of a short fixed campaign: the same number from every sound build and
  /// processor of one version. Takes some tenths of a second. That of a model which cannot simulate
  /// is what was found where it could.
  /// @param set  One of available_instruction_sets().
  [[nodiscard]] virtual std::uint64_t reference_digest(InstructionSet set) const = 0;

  /// The text by which others know the model who do not have its program, see
  /// proto/model_program/README.md. Empty if it has none, as models in C++.
  [[nodiscard]] virtual std::string_view description() const { return {}; }
  /// Of what description() says of the results: the same where only limits differ, such as the time
  /// that a run may take. 0 without a description.
  [[nodiscard]] virtual std::uint64_t description_digest() const { return 0; }
  /// Why nothing computes runs of a model that is known by its description alone, and what to do;
  /// empty for one that can. What needs it to compute throws an Error with this text.
  [[nodiscard]] virtual std::string why_no_runs() const { return {}; }
  [[nodiscard]] bool can_simulate() const { return why_no_runs().empty(); }
  /// True if another program computed the results of its only campaign, and nothing computes more.
  [[nodiscard]] virtual bool is_imported() const { return false; }

  /// What a device proves before it computes anything that counts.
  struct DeviceProof {
    std::uint64_t digest = 0;  ///< reference_digest() by the device's own kernels.
    std::size_t capacity = 0;  ///< DeviceSimulation::capacity().
  };
  /// @return Nothing if the model, or this build, has nothing for devices.
  /// @throws DeviceError
  [[nodiscard]] virtual std::optional<DeviceProof> prove(Device& /*device*/) const {
    return std::nullopt;
  }

  /// The campaign of a definition that another program sent or stored.
  ///
  /// @param definition  Anything at all. Time and memory are in proportion to its size.
  /// @param source      For messages: where it is from.
  /// @throws DefinitionError unless it is, to the byte, the definition of a valid campaign.
  [[nodiscard]] virtual std::unique_ptr<Campaign> campaign_of(Definition definition,
                                                              TableColumns columns,
                                                              std::string_view source) const = 0;

  /// The campaign of a campaign file, completed with the nominal values and checked.
  /// @throws DefinitionError naming file, line, field, value and rule.
  [[nodiscard]] virtual std::unique_ptr<Campaign> read_campaign(Document& document,
                                                                DataFiles& files) const = 0;

  /// What the sessions of a campaign of this model find out, without its noise being simulated.
  /// @return Null if the model has no bound of it.
  /// @throws ConfigError if its sessions cannot be estimated by the method that has one.
  [[nodiscard]] virtual std::unique_ptr<PlanStudy> study(const Campaign& /*campaign*/) const {
    return nullptr;
  }
  /// Whether study() takes these sessions; at once, so that it may still find that they do not
  /// determine every quantity.
  [[nodiscard]] virtual bool can_study(const Campaign& /*campaign*/) const { return false; }

  /// The text of a data file that campaigns name and that follows from physics, for the sessions of
  /// one campaign.
  ///
  /// @param campaign  The campaign file; the data files that it names are not read.
  /// @param physics   What differs from the nominal physics.
  /// @param session   The session that the file is for; empty: all of them.
  /// @return Without text if the model has no such file.
  /// @throws DefinitionError, or ConfigError about `session`
  [[nodiscard]] virtual EnvironmentFile environment_file(Document& /*campaign*/,
                                                         Document& /*physics*/,
                                                         const std::string& /*session*/) const {
    return {};
  }

  /// A campaign file with every key at its nominal value, its meaning and its rule.
  [[nodiscard]] virtual std::string example() const = 0;
  /// The file that the example is written to unless the user names another: `hardy2013.toml`.
  [[nodiscard]] virtual std::string_view example_file() const = 0;
};

/// The model that is chosen where a program is linked: each program is linked with exactly one
/// library that defines this function.
[[nodiscard]] const Model& built_in_model();

/// Further models that a program is linked with; it is defined where built_in_model() is chosen.
[[nodiscard]] std::vector<const Model*> further_models();

/// The models that this program can simulate: those of use_models(), the built-in one, and
/// further_models().
[[nodiscard]] std::span<const Model* const> models();

/// The first of models(): that of campaign files that name none, and of help texts.
[[nodiscard]] inline const Model& model() { return *models().front(); }

/// That of models() with this version; null if there is none.
[[nodiscard]] const Model* find_model(std::string_view version);

/// Versions of models(), for messages: `hardy2013-11 and oscillator-1`.
[[nodiscard]] std::string model_versions();

/// `hardy2013` of the version `hardy2013-11`; empty if there is no such name.
[[nodiscard]] std::string_view name_of_model(std::string_view version);

/// Puts models before the built-in one, before anything asks for models().
/// @param others  Live as long as the program; each has another version.
void use_models(std::vector<const Model*> others);

/// The results of the campaign that Model::example() describes, for help texts and for limits that
/// are needed before a campaign is known.
[[nodiscard]] inline ResultSchema example_results() {
  return model().results_of({}, model().version());
}

}  // namespace proofmass
