#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass {

/// Probed runs that are lost for one reason.
struct PlanLoss {
  std::string cause;         ///< One of ResultSchema::loss_causes, or `not_converged`.
  std::string session;       ///< Where, as RunResult::loss has it or by its name; empty if nowhere.
  std::string detail;        ///< What is beyond which limit, for people.
  std::size_t num_runs = 0;  ///< ≥ 1.
};

/// Warnings of probed runs that are not lost: something may move estimates beyond their bounds.
struct PlanWarnings {
  std::size_t num_runs = 0;      ///< Runs with a warning; 0: the rest says nothing.
  double largest_part = 0.0;     ///< Of an objective, as Warning::part.
  std::size_t quantity = 0;      ///< Whose objective that is.
  std::string_view effect = {};  ///< As Warning::effect.
};

/// How well the estimates of a run can be known, before any run is computed.
struct PlanBound {
  /// Of each quantity, SI: mean over the instruments.
  std::vector<double> standard_errors;
  /// Of each: probability that a run is lost or has an error beyond the objective.
  std::vector<double> misses;
  /// Probability that a run is lost or misses one or more objectives; at most so much if errors are
  /// correlated.
  double misses_any = 0.0;
  /// Mean total of the campaign's ErrorBudget, if it has one, in runs that are not lost.
  std::optional<double> mean_budget{};
  /// What loses probed runs, most of them first.
  std::vector<PlanLoss> losses{};
  PlanWarnings warnings{};

  /// Probed runs that are lost.
  [[nodiscard]] std::size_t num_lost() const {
    std::size_t sum = 0;
    for (const PlanLoss& loss : losses) sum += loss.num_runs;
    return sum;
  }
};

/// What an allocation is to make best.
enum class PlanGoal : std::uint8_t {
  objectives = 1,  ///< The chance that all objectives hold.
  budget = 2,      ///< The mean budget.
};

/// What a study is about.
struct PlanScope {
  std::string method;  ///< Of estimation, that the bound is of, whatever that of the campaign is.
  std::vector<std::string> sessions{};  ///< Their names.
  std::vector<int> num_steps{};         ///< Of each session in the campaign.
  /// Of a run in sessions that the study is not about: it leaves them as they are.
  int num_steps_beside = 0;
  int num_steps_min = 1;  ///< That a session may have.
  int num_steps_max = 0;
  std::size_t num_instruments = 0;  ///< Drawn, that a bound is the mean over.
  std::size_t num_probed = 0;       ///< Runs that were simulated, in short sessions.
  /// Of these, those whose data do not fit what the method takes them for, each by itself or all
  /// together: its errors are larger than the bound.
  std::size_t num_misfits = 0;
  /// Parts whose data, of all probed runs together, do not fit: their names.
  std::vector<std::string> misfits{};
  /// ErrorBudget::level by all probed runs that are not lost, fitted together, SI; 0 if they tell
  /// none, so that the assumed one holds.
  double probed_level = 0.0;
};

/// What the sessions of a campaign's runs find out together, whatever their lengths are.
class PlanStudy {
 public:
  virtual ~PlanStudy() = default;

  [[nodiscard]] virtual const PlanScope& scope() const = 0;

  /// What makes the standard error of a quantity smaller, as a noun: `longer sessions`.
  [[nodiscard]] virtual std::string remedy(std::size_t quantity) const = 0;

  /// What alone keeps the standard error of a quantity above its objective if the same sessions
  /// were endless, as a noun; empty if nothing does.
  [[nodiscard]] virtual std::string limit(std::size_t quantity) const = 0;

  /// The bound if the sessions had these lengths.
  /// @param num_steps  Of each session, ≥ 1.
  [[nodiscard]] virtual PlanBound bound(std::span<const int> num_steps) const = 0;

  /// What grows with the goal, in runs that are not lost: the logarithm of the odds that all
  /// objectives hold, which has a slope also where the chance rounds to 0 or 1, or the mean budget
  /// with its sign changed. Takes some 10 µs an instrument, and three times as long with 64
  /// sessions.
  /// @pre For `budget` the bounds have a mean_budget.
  [[nodiscard]] virtual double merit(PlanGoal goal, std::span<const int> num_steps) const = 0;

  /// The campaign file, commented, in which the sessions have these lengths and runs are estimated
  /// as the bound says.
  /// @throws ConfigError if a session cannot have its length.
  [[nodiscard]] virtual std::string campaign_file(std::span<const int> num_steps) const = 0;
};

}  // namespace proofmass
