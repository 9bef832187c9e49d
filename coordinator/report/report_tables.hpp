#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
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
/// Whether the bias differs from 0 if all parameters are looked at together (Holm, 5 %), by
/// Student's law. False also where nothing tells: of one run, of draws that are not independent,
/// and of errors that are too skewed for that law.
[[nodiscard]] bool is_biased(const Review& review, std::size_t quantity);
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

/// A value of a quantity in its display unit, as a report spells it: `32.4 nm`, `11.6×10⁻⁴ rad`.
[[nodiscard]] std::string quantity_text(double value, const Quantity& quantity);

/// A name, or the symbol of the quantity that has it: sessions are called after what they are for.
[[nodiscard]] std::string name_in_symbols(const ResultSchema& schema, std::string_view name);

/// True of a requirement that nobody stated: an objective of the campaign, or all together.
[[nodiscard]] bool is_default(const RequirementAnswer& row);

/// The id of a requirement; of an objective of the campaign, the symbol of its parameter.
[[nodiscard]] std::string requirement_name(const RequirementAnswer& row);

[[nodiscard]] Table matrix_table(const Review& review);

/// budget_table() with the numbers of its notes in the spelling of documents.
[[nodiscard]] Table review_budget_table(const Review& review);

/// The sums that explain the errors. No rows without causes.
[[nodiscard]] Table cause_table(const Review& review);

/// The lines that the estimates use, and the noise about them. @pre There are spectra.
[[nodiscard]] Table spectrum_table(const Review& review);

/// What was run: identity, counts, digest.
[[nodiscard]] Table identity_table(const Review& review);

/// Workers, core hours, losses.
[[nodiscard]] Table execution_table(const Review& review);
[[nodiscard]] Table host_table(const Review& review);

/// The commands that repeat or check what the report shows, each with what it does.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> reproducing_commands(
    const Review& review);

/// A sentence that may be quoted, and what it follows from.
struct SummarySentence {
  std::string text;
  std::string section;  ///< Title of the section of the report that has the figures.
};

/// Five sentences: what was asked, how many draws there are, the verdicts, what drives the worst
/// error, and what the errors leave of the budget.
[[nodiscard]] std::vector<SummarySentence> review_summary(const Review& review);

}  // namespace proofmass::coordinator
