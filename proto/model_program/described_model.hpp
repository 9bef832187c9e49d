#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/error.hpp"
#include "core/model.hpp"

namespace proofmass::detail {
struct Entry;
}  // namespace proofmass::detail

namespace proofmass::wire {

/// A model program cannot be started, ended, is silent, answers what it must not, or is not there.
class ModelProgramError : public Error {
 public:
  using Error::Error;
};

/// The code of a model program is no longer that of its reference runs: no result of it may count
/// for their digest, and only a process that computes them anew can go on.
class ModelProgramChanged : public Error {
 public:
  using Error::Error;
};

/// Most bytes of a line that a model program answers, and of a description.
inline constexpr std::size_t answer_size_max = std::size_t{1} << 20;

/// What a model program may take.
struct ProgramLimits {
  std::size_t answer_time_max_s = 600;  ///< For each answer.
  std::size_t memory_max_mib = 4096;    ///< Of data, which counts once it is asked for.
};

/// A number that the runs of a campaign share, and that a campaign file may change.
struct ProgramParameter {
  std::string name;
  double value = 0.0;  ///< Unless the campaign file has another one.
};

/// Most runs that a program is asked for together.
inline constexpr std::size_t runs_at_once_max = 64;

/// What a model program estimates in each run. The engine knows the true value: an expression of
/// drawn quantities and parameters, see evaluate_expression().
struct ProgramQuantity {
  std::string name;
  std::string symbol;      ///< For people; the name by default.
  std::string unit = "1";  ///< SI.
  double display_scale = 1.0;
  bool has_display_scale = false;
  std::string display_unit;  ///< `unit` by default, after a scale that is given.
  std::string truth;
  double objective = std::numeric_limits<double>::infinity();
  bool has_standard_error = false;
};

/// What a model program says of itself when it is asked.
struct ProgramDescription {
  std::string text;  ///< All of it as JSON without blanks, keys in alphabetical order.
  /// fnv1a() of such a text without the purpose and the limits, which change no result.
  std::uint64_t digest = 0;
  std::string version;  ///< NAME-VERSION, as Model::version().
  std::string purpose;
  /// The file that results of another program came from, which are all that there is of the model:
  /// no program computes it again. Empty for a model program.
  std::string imported_from;
  std::vector<ProgramParameter> parameters;
  std::vector<std::string> drawn_names;  ///< Of what it draws for each run.
  std::vector<std::string> drawn_units;
  std::vector<Dispersion> laws;  ///< Of each of these, unless the campaign file has another one.
  std::vector<ProgramQuantity> quantities;
  std::vector<std::string> streams;  ///< Of random numbers, each with a seed of its own in a run.
  std::size_t runs_at_once = 1;      ///< That it is asked for together.
  ProgramLimits limits;

  [[nodiscard]] LawSet law_set(std::span<const Dispersion> of) const {
    return {.names = drawn_names, .laws = of, .table = "drawn"};
  }
};

/// The name of a quantity, parameter or stream, as files and SQL can have it; empty if it is
/// refused.
/// @param path  Of what has it.
[[nodiscard]] std::string read_name(Document& document, const std::string& path);

/// @param answer  JSON that a program answered or a database holds: anything at all.
/// @param source  For messages: where it is from.
/// @throws DefinitionError naming source, field, value and rule, also of a key that is none.
[[nodiscard]] ProgramDescription description_in(std::string_view answer, const std::string& source);

class DescribedModel;

/// A campaign of a model that a description tells of.
class DescribedCampaign final : public Campaign {
 public:
  /// @param of  Outlives it.
  explicit DescribedCampaign(const DescribedModel& of);

  std::vector<double> parameters;  ///< Of each of the description's.
  std::vector<Dispersion> laws;    ///< Of each drawn quantity.
  bool is_digest_tolerated = false;

  /// Takes what a campaign file changes. @throws DefinitionError
  void read(Document& document);

  [[nodiscard]] const Model& model() const override;
  void validate(TableColumns columns = TableColumns::included) const override;
  [[nodiscard]] std::unique_ptr<Campaign> clone() const override {
    return std::make_unique<DescribedCampaign>(*this);
  }
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  /// As TOML, in the one form that Model::campaign_of() takes.
  [[nodiscard]] Definition definition(TableColumns columns) const override;
  [[nodiscard]] std::vector<DefinitionItem> items() const override;
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override;
  [[nodiscard]] ResultSchema results() const override;
  [[nodiscard]] std::vector<double> objectives() const override { return objectives_; }
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override {
    return table_elements(laws);
  }
  [[nodiscard]] RunDraw draw(RunIndex run) const override { return drawn(run, table_values(run)); }
  [[nodiscard]] bool tolerates_digests() const override { return is_digest_tolerated; }
  [[nodiscard]] std::string note() const override;
  /// @param table_values  As table_values() of the run.
  [[nodiscard]] RunDraw drawn(RunIndex run, std::span<const double> table_values) const;

  [[nodiscard]] const ProgramDescription& description() const;
  [[nodiscard]] LawSet law_set() const;

 private:
  [[nodiscard]] std::vector<proofmass::detail::Entry> entries() const;

  const DescribedModel* model_;
  std::vector<double> objectives_;
};

/// Called with the time by which a process of a program had loaded its code.
using OnProcessStart = std::function<void(std::chrono::steady_clock::time_point loaded_at)>;

/// What a description lacks, the program itself: it makes a plan, whose batches throw ConfigError
/// naming the parameter that the program refuses, if it does.
///
/// @param on_start  For each process before it computes runs.
using PrepareProgram = std::function<std::unique_ptr<const Plan>(const DescribedCampaign& campaign,
                                                                 OnProcessStart on_start)>;

/// A model that a description tells of, with its program or without: then it does all that needs no
/// simulation.
class DescribedModel final : public Model {
 public:
  /// @param reference_digest  As the program computed it elsewhere; nothing: it is computed here.
  /// @param prepare           Null without the program: what needs it throws ModelProgramError.
  DescribedModel(ProgramDescription description, std::optional<std::uint64_t> reference_digest,
                 PrepareProgram prepare);

  [[nodiscard]] std::string_view version() const override { return parts_.version; }
  [[nodiscard]] std::string_view purpose() const override { return parts_.purpose; }
  [[nodiscard]] ResultSchema results_of(std::string_view, std::string_view) const override;
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override { return drawn_; }
  [[nodiscard]] std::string_view step_name() const override { return "steps"; }
  [[nodiscard]] std::size_t batch_size() const override { return parts_.runs_at_once; }
  /// Of description_digest() and the first three runs of the example, which are computed once.
  [[nodiscard]] std::uint64_t reference_digest(InstructionSet set) const override;
  [[nodiscard]] std::string_view description() const override { return parts_.text; }
  [[nodiscard]] std::uint64_t description_digest() const override { return parts_.digest; }
  [[nodiscard]] std::string why_no_runs() const override;
  [[nodiscard]] bool is_imported() const override { return !parts_.imported_from.empty(); }
  [[nodiscard]] std::unique_ptr<Campaign> campaign_of(Definition definition, TableColumns,
                                                      std::string_view source) const override;
  [[nodiscard]] std::unique_ptr<Campaign> read_campaign(Document& document,
                                                        DataFiles&) const override;
  [[nodiscard]] std::string example() const override;
  [[nodiscard]] std::string_view example_file() const override { return example_file_; }

  [[nodiscard]] const ProgramDescription& parts() const { return parts_; }
  /// @throws ModelProgramError that says how to name the program if it is not there.
  [[nodiscard]] std::unique_ptr<const Plan> prepare(const DescribedCampaign& campaign) const;
  /// Has the last of the reference runs computed again, once, see below.
  void require_repeatable() const;
  /// The same for a process whose code was loaded by that time, unless it was done after that: the
  /// code may have changed since the reference runs. If they are not computed, it does nothing.
  void require_repeatable_since(std::chrono::steady_clock::time_point loaded_at) const;
  /// reference_digest() as older programs took it: of all that a description says.
  /// @pre The program is there.
  [[nodiscard]] std::uint64_t former_reference_digest(std::string_view description) const;

 private:
  /// A plan for the reference runs, whose processes need not repeat them.
  [[nodiscard]] std::unique_ptr<const Plan> reference_plan() const;
  /// Of the estimates of the reference runs, after what the digest begins with.
  [[nodiscard]] std::uint64_t digest_of_reference_runs(std::uint64_t digest) const;

  ProgramDescription parts_;
  PrepareProgram prepare_;
  std::vector<DrawnQuantity> drawn_;
  std::string example_file_;
  const std::optional<std::uint64_t> reference_digest_;  // As computed elsewhere.
  mutable std::mutex reference_mutex_;
  mutable std::vector<RunResult> reference_runs_;  // Empty: not computed yet.
  mutable std::optional<std::chrono::steady_clock::time_point> repeated_at_;  // When it began.
};

/// Refuses what is drawn under the name of a column of results, which would be confused with it,
/// and names that have another meaning in expressions and requirements. Databases may have such
/// names.
/// @param source  For messages: where the description is from.
/// @throws DefinitionError
void check_names(const DescribedModel& model, const std::string& source);

/// Has the run computed again by a process of the program that no other run came before.
/// @param plan  New, of a campaign of a model with its program.
/// @throws ModelProgramChanged if the result is another one, which follows not from its question
///         alone: then nobody could check it.
void require_repeatable(const Campaign& campaign, const Plan& plan, const RunResult& result);
/// Of a reference run of the model, if that is a program.
void require_repeatable(const Model& model);

/// What a run of these models found out. Standard errors are taken as those of independent
/// estimates.
/// @param errors  Of the quantities that have one. If a number is out of range or an error
/// negative,
///                the run is not finite.
void set_estimates(std::vector<double> estimate, std::vector<double> errors, RunResult& result);
/// A run without any estimate.
void set_lost(RunResult& result);

/// The model of a description, without its program. It lives as long as this program, as do the
/// texts of its results; the same description and digest yield the same model.
/// @param reference_digest  As of DescribedModel; 0 if it is not known.
/// @param source            For messages: where the description is from.
/// @throws DefinitionError if it breaks a rule, or if this program has read too many.
[[nodiscard]] const DescribedModel& described_model(const std::string& text,
                                                    std::uint64_t reference_digest,
                                                    const std::string& source);

/// By which a database, or a client, says what a campaign's model is. All of it may be anything.
struct ModelRecord {
  std::string version = {};
  std::string description = {};  ///< Model::description().
  /// Model::reference_digest() of a model with a description; 0 if it was not recorded.
  std::uint64_t reference_digest = 0;
};

/// The digest of a record as Model::reference_digest() is now: older programs took purpose and
/// limits into it.
/// @param model  Of the record; if its program is not there, the digest is left as it is.
[[nodiscard]] std::uint64_t current_reference_digest(const Model& model, const ModelRecord& record);

/// The model of a campaign from elsewhere: that of models() if it is there; else what is said of
/// it, see described_model().
/// @throws DefinitionError `is of the model ...` if there is no description of it, or one that
///         breaks a rule.
[[nodiscard]] const Model& recorded_model(const ModelRecord& record);

/// By which a database says what its campaign is. All of it may be anything.
struct CampaignTexts {
  std::string definition = {};
  std::string name = {};
  std::string seed = {};
  std::string num_runs = {};
};

/// The campaign of a database.
/// @param model     recorded_model().
/// @param database  By which SQL knows it, in quotes.
/// @param numbers   Yields those of the rows of a query, row by row.
/// @throws DefinitionError if the definition is none of the model, or another campaign's.
[[nodiscard]] std::shared_ptr<const Campaign> recorded_campaign(
    const Model& model, const CampaignTexts& record, const std::string& database,
    const std::function<std::vector<double>(const std::string& sql)>& numbers);

}  // namespace proofmass::wire
