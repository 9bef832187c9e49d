#pragma once

#include <optional>
#include <vector>

#include "coordinator/report/review.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {

// The tables of `proofmass report`, which are those of a review report and of the live page, too.
// Without an estimate, a table has no rows unless it says otherwise.

/// A number in the display unit, and in SI units for programs; a dash if there is none.
[[nodiscard]] Cell figure_cell(const std::optional<double>& value, double scale = 1.0);
[[nodiscard]] Cell no_figure();
/// Adds the cells of the ends of an interval; of none, two without a figure.
void add_ends(const std::optional<Interval>& interval, double scale, Row& row);
/// Of |error|: of few values the symmetric interval of a mean may begin below 0, where none can
/// lie.
[[nodiscard]] std::optional<Interval> not_negative(std::optional<Interval> interval);
/// The unit in which a table shows a quantity.
[[nodiscard]] Cell unit_cell(const Quantity& quantity);

/// Accuracy of each parameter beside the published one, and whose that is; always with rows.
[[nodiscard]] Table accuracy_table(const Review& review);

/// What the draws that were made say about all draws: 95 % intervals of mean and standard
/// deviation, and the errors' bias and skewness. No rows if they are not independent.
[[nodiscard]] Table interval_table(const Review& review);

/// Of the error with its sign the interval of its bias; percentiles of |error|; how often a
/// parameter is beyond its objective; and how often all objectives hold together. One line says
/// which biases differ from 0 if all parameters are looked at together: a table of ten intervals
/// invites to look for one without 0, which chance alone makes in 40 % of all campaigns. Of draws
/// that are not independent bias, skewness and percentiles without intervals, and the reason.
[[nodiscard]] Table error_table(const Review& review);

/// The three tables above.
[[nodiscard]] std::vector<Table> accuracy_tables(const Review& review);

/// The tables whose unit is an instrument or a replicate, of several runs each.
[[nodiscard]] std::vector<Table> group_tables(const Review& review);

/// Budget before and after estimation beside the published one, and what single runs have. A
/// campaign without a budget has no rows; one without an estimate has.
[[nodiscard]] Table budget_table(const Review& review);

}  // namespace proofmass::coordinator
