#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace proofmass {

/// How well the estimates of a run can be known, before any run is computed.
struct PlanBound {
  std::vector<double> standard_errors;  ///< Of each quantity, SI: mean over the instruments.
  std::vector<double> misses;           ///< Of each: probability of an error beyond its objective.
  double misses_any = 0.0;              ///< Probability that one or more objectives are missed.
  std::optional<double>
      mean_budget{};  ///< Mean total of the campaign's ErrorBudget, if it has one.
};

/// What the sessions of a campaign's runs find out together, whatever their lengths are.
class PlanStudy {
 public:
  virtual ~PlanStudy() = default;

  /// Estimation method that the bound is of, whatever that of the campaign is.
  [[nodiscard]] virtual std::string method() const = 0;
  [[nodiscard]] virtual std::vector<std::string> session_names() const = 0;
  /// Steps of each session in the campaign.
  [[nodiscard]] virtual std::vector<int> num_steps() const = 0;
  /// Drawn instruments that a bound is the mean over.
  [[nodiscard]] virtual std::size_t num_instruments() const = 0;

  /// The bound if the sessions had these lengths. Takes some 100 µs.
  /// @param num_steps  Of each session, ≥ 1.
  [[nodiscard]] virtual PlanBound bound(std::span<const int> num_steps) const = 0;

  /// The campaign file, commented, in which the sessions have these lengths and runs are estimated
  /// as the bound says.
  /// @throws ConfigError if a session cannot be so short.
  [[nodiscard]] virtual std::string campaign_file(std::span<const int> num_steps) const = 0;
};

}  // namespace proofmass
