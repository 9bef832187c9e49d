#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {

/// Everything that `proofmass report` prints: summary and all tables. Lines have at most 80
/// characters.
[[nodiscard]] std::string report_text(const Review& review, Paint paint = Paint::no);

/// summary_rows() as lines.
[[nodiscard]] std::string summary_text(const Review& review);

/// Campaign::note() under its name, as lines of summary_text(); empty if there is none.
[[nodiscard]] std::string note_text(const std::string& note);

/// The line that names the runs that were given up; empty if there are none.
/// @param given_up  Ascending.
[[nodiscard]] std::string given_up_text(std::span<const RunRange> given_up,
                                        Paint paint = Paint::no);

/// What report_text() tells, and the answers to requirements, as JSON for
/// programs, with the verification matrix: in full precision and SI units.
/// coordinator/cli/README.md lists the keys.
/// @param stated  The requirements whose answers are listed beside the matrix, which has them.
[[nodiscard]] nlohmann::ordered_json report_json(const Review& review,
                                                 std::span<const StatedRequirement> stated = {});

/// The report of a review as one page of HTML, which needs no other file, no network and no script
/// and allows none. It begins with review_summary() and the verification matrix. The same bytes for
/// the same review.
[[nodiscard]] std::string review_html(const Review& review);

/// The style that html_table() and embedded charts need: rules of CSS without their element.
/// Colours are custom properties, for light and dark.
[[nodiscard]] std::string review_style();

/// The matrix and the tables of a review report in Markdown (CommonMark with tables), without
/// charts.
[[nodiscard]] std::string review_markdown(const Review& review);

// The tables of `proofmass report`, which are those of a review report and of the live page, too.
// Without an estimate, a table has no rows unless it says otherwise.

/// A number in the display unit, and in SI units for programs; a dash if there is none.
[[nodiscard]] Cell figure_cell(const std::optional<double>& value, double scale = 1.0);
[[nodiscard]] Cell no_figure();
inline constexpr double percent_scale = 0.01;
/// Adds a column with its cell in each row of the table, which are there already.
void add_column(Table& table, Column column,
                const std::function<Cell(std::size_t row)>& cell_of_row);
/// Adds the columns of the ends of an interval, in the scale of each row; of none, two without a
/// figure.
using IntervalAndScale = std::pair<std::optional<Interval>, double>;
void add_ends(Table& table, Column from, Column to,
              const std::function<IntervalAndScale(std::size_t row)>& of_row);
/// Of |error|: of few values the symmetric interval of a mean may begin below 0, where none can
/// lie.
[[nodiscard]] std::optional<Interval> not_negative(std::optional<Interval> interval);
/// `a, b`, the symbols of those quantities of which is_one(index) holds.
[[nodiscard]] std::string symbols_of(const ResultSchema& schema,
                                     const std::function<bool(std::size_t)>& is_one);
/// Whether the bias differs from 0 if all parameters are looked at together (Holm, 5 %), by
/// Student's law. False also where nothing tells: of one run, of draws that are not independent,
/// and of errors that are too skewed for that law.
[[nodiscard]] bool is_biased(const Review& review, std::size_t quantity);
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

/// The tables whose unit is an instrument or a replicate, of several runs each.
[[nodiscard]] std::vector<Table> group_tables(const Review& review);

/// Budget before and after estimation beside the published one, and what single runs have. A
/// campaign without a budget has no rows; one without an estimate has.
[[nodiscard]] Table budget_table(const Review& review);

/// What a reader of a budget should know: what its level is, and ErrorBudget::note line by line.
/// @param unit  Of the level.
/// @param told  Of which runs the level is, with its value: `the runs: worst 2, mean 1`; empty if
///              no run tells it, so that the assumed one holds.
[[nodiscard]] std::vector<std::string> level_notes(const ErrorBudget& budget, std::string_view unit,
                                                   std::string_view told);

/// A value of a quantity in its display unit, as a report spells it: `32.4 nm`, `11.6×10⁻⁴ rad`.
/// @param num_digits  Of figure_text().
[[nodiscard]] std::string quantity_text(double value, const Quantity& quantity, int num_digits = 3);

/// A name, or the symbol of the quantity that has it: sessions are called after what they are for.
[[nodiscard]] std::string name_in_symbols(const ResultSchema& schema, std::string_view name);

/// The id of a requirement; of an objective of the campaign, the symbol of its parameter.
[[nodiscard]] std::string requirement_name(const RequirementAnswer& row);

/// Name, seed if it is known, digest, and how many runs ended how, each behind its name; what goes
/// on about the one before has none. A row says so if the digest could not be checked.
[[nodiscard]] std::vector<Row> summary_rows(const Review& review);

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

// The charts of a review report. Values are in the units of its tables.

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

/// `spectrum:SESSION`, the name of a session's chart.
[[nodiscard]] std::string spectrum_name(std::string_view session);

/// A chart with the name by which `proofmass plot` knows it: `histogram:gain`.
struct NamedPicture {
  std::string name;  ///< Empty: it does not know it.
  Picture picture;
};

/// Text of HTML, which Markdown leaves out.
struct Markup {
  std::string html;
};

/// What is shown beside each other, as far as there is room. Tables without rows and notes are
/// left out.
using Part = std::variant<Table, NamedPicture, Markup>;

// The sections of a review report that are made of more than tables of `proofmass report`.
[[nodiscard]] std::vector<Part> verification_parts(const Review& review);
[[nodiscard]] std::vector<Part> error_parts(const Review& review);
[[nodiscard]] std::vector<Part> budget_parts(const Review& review);
[[nodiscard]] std::vector<Part> cause_parts(const Review& review);
[[nodiscard]] std::vector<Part> spectrum_parts(const Review& review);
[[nodiscard]] std::vector<Part> run_parts(const Review& review);

/// All that have a name: two overviews, and those of the report in its order.
[[nodiscard]] std::vector<NamedPicture> review_pictures(const Review& review);

}  // namespace proofmass::coordinator
