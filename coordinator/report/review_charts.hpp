#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

// The charts of a review report. Values are in the units of its tables.

/// |error| of a quantity on a logarithmic axis, with its objective and the worst runs.
[[nodiscard]] Chart magnitude_chart(const Review& review, std::size_t quantity);

/// The error with its sign, with the interval of its bias.
[[nodiscard]] Chart error_chart(const Review& review, std::size_t quantity);

/// Worst, mean and standard deviation of |error| against the number of runs.
[[nodiscard]] Chart convergence_chart(const Review& review, std::size_t quantity);

/// |error| of all quantities beside each other, in units of their objectives; of those that have
/// none, in units of the worst.
[[nodiscard]] ChartGrid magnitude_overview(const Review& review);

/// The relative half width of the intervals of mean and standard deviation, of all quantities.
[[nodiscard]] ChartGrid convergence_overview(const Review& review);

/// The probability that a campaign of as many draws meets requirements of one coverage and
/// confidence, against the probability with which a draw exceeds their limit. One chart for each
/// coverage and confidence of the matrix, in the order of their first rows.
[[nodiscard]] std::vector<Chart> characteristic_charts(const Review& review);

/// Nothing if the campaign has no budget.
[[nodiscard]] std::optional<BarChart> budget_chart(const Review& review);

/// Nothing without causes.
[[nodiscard]] std::optional<HeatMap> cause_map(const Review& review);

/// One for each session with a spectrum: measured, without the fitted lines, and of the noise
/// model. @pre There are spectra.
[[nodiscard]] std::vector<Chart> spectrum_charts(const Review& review);

/// `spectrum:SESSION`, the name of a session's chart.
[[nodiscard]] std::string spectrum_name(std::string_view session);

/// A chart with the name by which `proofmass plot` knows it: `histogram:gain`.
struct NamedPicture {
  std::string name;  ///< Empty: it does not know it.
  Picture picture;
};

/// All that have a name: two overviews, and those of the report in its order.
[[nodiscard]] std::vector<NamedPicture> review_pictures(const Review& review);

/// True if a chart of this name needs Review::causes.
[[nodiscard]] bool needs_causes(std::string_view name);

}  // namespace proofmass::coordinator
