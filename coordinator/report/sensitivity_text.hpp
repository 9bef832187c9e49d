#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "coordinator/report/drawn_runs.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// Runs that sensitivities are computed from at most: a million would take minutes and say no more.
/// The texts say so where a campaign has more.
inline constexpr std::uint64_t sensitivity_runs_max = 100'000;

/// Which drawn quantities drive a parameter's error, and which its magnitude: the first `num_rows`
/// of sensitivities() of each, and the error as a sum of explanatory_terms(), and how to ask why
/// the worst run is so. Lines have at most 80 characters.
/// @throws InvalidArgument below 16 runs.
[[nodiscard]] std::string sensitivity_text(const DrawnRuns& drawn, std::size_t quantity,
                                           std::size_t num_rows);

/// Why a run is as far off as it is: the place of its |error| among the runs, and its values of the
/// quantities that drive |error| and error of the parameter, each with its percentile.
/// @throws InvalidArgument if the run is not among those, or they are below 16.
[[nodiscard]] std::string explanation_text(const DrawnRuns& drawn, std::size_t quantity,
                                           RunIndex run, std::size_t num_rows);

/// Both for programs, of these parameters, in full precision and SI units; of the run's values only
/// if there is one. coordinator/cli/README.md lists the keys.
/// @throws InvalidArgument if the run is not among those, or they are below 16.
[[nodiscard]] std::string sensitivity_json(const DrawnRuns& drawn,
                                           std::span<const std::size_t> quantities,
                                           std::optional<RunIndex> run, std::size_t num_rows);

/// The parameter whose |error| is the largest in units of its objective; of those without
/// objectives, the one for which the |error| has the highest rank.
/// @param objectives  Those of the campaign's scenario, one a parameter.
/// @throws InvalidArgument if the run is not among those.
[[nodiscard]] std::size_t worst_quantity_of(const DrawnRuns& drawn, RunIndex run,
                                            std::span<const double> objectives);

/// Which parameter that is and why, in lines of at most 80 characters.
/// @throws InvalidArgument if the run is not among those.
[[nodiscard]] std::string choice_text(const DrawnRuns& drawn, RunIndex run,
                                      std::span<const double> objectives);

}  // namespace proofmass::coordinator
