#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/math/instruction_set.hpp"
#include "core/runs.hpp"

namespace proofmass {

class Device;  // Those who simulate on one include core/campaign/device.hpp.
class DeviceSimulation;
class Model;       // Those who ask it include core/model.hpp.
struct Recording;  // Those who replay a run include core/campaign/recording.hpp.
struct RecordedSample;

/// Takes the samples of a run, in the order of sessions and times. What it throws ends the replay.
using SampleSink = std::function<void(const RecordedSample&)>;

/// A term of an error budget, with its published figures.
struct BudgetEntryInfo {
  std::string_view name;   ///< In SQL: `t_xx_delta_x`.
  std::string_view label;  ///< For people: `a_c11·T_xx·Δx`.
  double paper_before;
  double paper_after_worst;  ///< Of the worst errors of all quantities, which no single run has.
  double paper_after_mean;
};

/// Contributions to the measurement that the estimates serve.
struct Budget {
  std::vector<double> entries;  ///< Of each term.
  double total = 0.0;           ///< Plain sum of the entries.
};

/// A term of an error budget: what the estimates' absence leaves in it, and what their errors do.
struct BudgetTerm {
  BudgetEntryInfo info;
  double before = 0.0;  ///< From the construction bounds, before any estimation.
  /// What an |error| of 1 (SI) of each quantity leaves.
  std::vector<double> coefficients;
  /// True if all of it is in proportion to ErrorBudget::level, and given for its assumed value.
  bool follows_level = false;
};

/// What estimation errors leave in the measurement that the estimates serve, m/s². Every term is
/// linear in the errors |estimate − truth|.
struct ErrorBudget {
  std::string_view title;  ///< `Budget of the test of ..., m/s²`.
  std::vector<BudgetTerm> terms;
  BudgetEntryInfo total_info;
  /// A health quantity of each run: its index. Results of older programs may lack it.
  std::size_t level = 0;
  std::string_view level_label = {};  ///< For people: `Γ_res`.
  double assumed_level = 1.0;         ///< Where no run tells it, SI.
  std::string note;                   ///< What a reader of the table should know; may be empty.

  /// @param level_of_runs  0: unknown, so that the assumed one holds.
  [[nodiscard]] Budget before(double level_of_runs) const;
  /// @param errors  |estimate − truth| of each quantity, SI.
  [[nodiscard]] Budget after(std::span<const double> errors, double level_of_runs) const;
  /// 0: unknown.
  [[nodiscard]] double level_of_run(const RunResult& result) const {
    return level < result.health.size() ? result.health[level] : 0.0;
  }
  /// What is left by the errors of one run, which has an estimate, at its own level.
  [[nodiscard]] Budget of_run(const RunResult& result) const;
};

/// Something that may have moved an estimate of a completed run by this part of its objective.
struct Warning {
  std::string_view effect;   ///< Of a constant string: `spin`; [a-z_]+.
  std::size_t quantity = 0;  ///< Index into the quantities of the ResultSchema.
  double part = 0.0;         ///< At most so much; a bound.
};

/// The warnings of a completed run: a pure function of its result.
using Warner = std::function<std::vector<Warning>(const RunResult&)>;

/// A run to be simulated, with campaign.table_values(run).
struct RunRequest {
  RunIndex run;
  std::vector<double> table_values;
};

/// Everything that the runs of a campaign share, made once and used for any run, by any number of
/// threads.
class Plan {
 public:
  virtual ~Plan() = default;

  /// Simulates runs and estimates what the model estimates. Each result is a pure function of the
  /// campaign and the request: the same bits in any batch, on any instruction set.
  ///
  /// @param requests  At most Model::batch_size().
  /// @param set       One of available_instruction_sets().
  /// @param progress  Called now and then with the number of steps done; the runs advance
  ///                  together.
  /// @return Results in the order of `requests`.
  [[nodiscard]] virtual std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet set,
      const std::function<void(int)>& progress = {}) const = 0;

  /// Simulates one run again, bit for bit, and passes all samples of its sessions on. It may take
  /// much longer than a run of a batch.
  ///
  /// @param sink      Gets nothing if no draw of the run was accepted.
  /// @param progress  As for simulate_batch(); an exception ends the replay.
  /// @return The result that simulate_batch() has for the request.
  [[nodiscard]] virtual RunResult replay(const RunRequest& request, const SampleSink& sink,
                                         const std::function<void(int)>& progress = {}) const = 0;

  /// True if devices can compute the campaign's runs; otherwise they are left to processors.
  [[nodiscard]] virtual bool runs_on_devices() const { return false; }
  /// The campaign's runs on a device.
  /// @param device  Outlives it, as does the plan. Nothing else is on it.
  /// @pre runs_on_devices().
  /// @throws DeviceError
  [[nodiscard]] virtual std::unique_ptr<DeviceSimulation> simulation_on(Device& device) const;

  /// What replay() passes on.
  [[nodiscard]] virtual const Recording& recording() const = 0;

  /// Steps of one run, which take about the same time each: what `progress` counts to.
  /// Model::step_name() says what they are.
  [[nodiscard]] virtual int num_steps() const = 0;
};

/// What a run begins with.
struct RunDraw {
  std::uint32_t num_draws = 0;  ///< As in RunResult.
  /// Of each of Model::drawn(); empty if no draw was accepted.
  std::vector<double> values{};
  std::vector<double> truth{};  ///< Of each quantity of the results, SI; empty without a draw.
};

/// What probabilities are over, in the terms of ECSS-E-ST-60-10C.
enum class Interpretation : std::uint8_t {
  ensemble,  ///< Instruments, as there is no noise.
  temporal,  ///< Realisations of the noise, as all runs have one instrument.
  mixed,     ///< Both together.
};

/// `ensemble`.
[[nodiscard]] std::string_view name_of(Interpretation interpretation);

/// A campaign of some model: everything its results depend on, and how many runs there are.
class Campaign {
 public:
  std::string name;
  std::uint64_t seed = 1;
  std::uint64_t num_runs = 100;
  /// Consecutive runs that share one draw and differ in their noise: those from i·realisations on
  /// have draw i.
  std::uint64_t realisations = 1;
  SamplingDesign design = {};  ///< How the draws are chosen.
  /// For each of table_quantities(), its value for every run; at least num_runs each.
  std::vector<std::vector<double>> table_columns;

  virtual ~Campaign() = default;

  /// The model that it is a campaign of; outlives it.
  [[nodiscard]] virtual const Model& model() const = 0;

  /// @param columns  Whether `table_columns` must be there.
  /// @throws ConfigError naming the field, its value and the rule.
  virtual void validate(TableColumns columns = TableColumns::included) const = 0;

  /// A copy, to be given another name or number of runs.
  [[nodiscard]] virtual std::unique_ptr<Campaign> clone() const = 0;

  /// What a worker needs to compute runs. @pre validate() passed, but for `table_columns`.
  [[nodiscard]] virtual std::unique_ptr<const Plan> prepare() const = 0;

  /// @pre validate() passed, but for `table_columns`.
  [[nodiscard]] virtual Definition definition(TableColumns columns) const = 0;
  /// Every key of the definition's text with its value, in the order of the text.
  [[nodiscard]] virtual std::vector<DefinitionItem> items() const = 0;
  /// Everything but the number of runs that two campaigns of one model do not share, in the order
  /// of a campaign file. The name of a data file whose values are the same is no difference.
  [[nodiscard]] virtual std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const = 0;

  /// What the results of its runs are: a pure function of its definition.
  /// @pre validate() passed, but for `table_columns`.
  [[nodiscard]] virtual ResultSchema results() const = 0;
  /// Largest acceptable |error| of each quantity, SI; infinite if there is none.
  [[nodiscard]] virtual std::vector<double> objectives() const = 0;
  /// Most estimation rounds of a run.
  [[nodiscard]] virtual std::int64_t num_rounds_max() const { return 1; }
  /// Drawn quantities whose values come from a table: indices into Model::drawn(), ascending.
  [[nodiscard]] virtual std::vector<std::size_t> table_quantities() const { return {}; }
  /// The draw that a run begins with. A pure function, some 11 µs. @pre The run is one of these.
  [[nodiscard]] virtual RunDraw draw(RunIndex run) const = 0;
  /// What differs from run to run.
  [[nodiscard]] virtual Interpretation interpretation() const { return Interpretation::mixed; }
  /// Whether runs may be computed where the model's reference digest is another one: then a result
  /// need not be the same on each machine.
  [[nodiscard]] virtual bool tolerates_digests() const { return false; }
  /// What whoever reads its results must know of how they came about: a sentence without its full
  /// stop; usually empty.
  [[nodiscard]] virtual std::string note() const { return {}; }
  /// Nothing if the model has none.
  [[nodiscard]] virtual std::optional<ErrorBudget> error_budget() const { return std::nullopt; }
  /// Null if the model gives no warnings.
  [[nodiscard]] virtual Warner warner() const { return nullptr; }

  /// Values of the `table` quantities for one run, in the order of table_quantities().
  [[nodiscard]] std::vector<double> table_values(RunIndex run) const;

 protected:
  Campaign() = default;
  Campaign(const Campaign&) = default;
  Campaign(Campaign&&) = default;
  Campaign& operator=(const Campaign&) = default;
  Campaign& operator=(Campaign&&) = default;
};

/// Most runs that share one draw.
inline constexpr std::uint64_t realisations_max = 4096;

/// The rules for the name, the seed and the numbers of runs and realisations.
/// @throws ConfigError naming the field, its value and the rule.
void check_identity(const Campaign& campaign);

}  // namespace proofmass
