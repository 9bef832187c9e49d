#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/report/review.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

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
