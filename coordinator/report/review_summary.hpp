#pragma once

#include <string>
#include <vector>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

/// A sentence that may be quoted, and what it follows from.
struct SummarySentence {
  std::string text;
  std::string section;  ///< Title of the section of the report that has the figures.
};

/// Five sentences: what was asked, how many draws there are, the verdicts, what drives the worst
/// error, and what the errors leave of the budget.
[[nodiscard]] std::vector<SummarySentence> review_summary(const Review& review);

}  // namespace proofmass::coordinator
