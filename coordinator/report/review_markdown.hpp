#pragma once

#include <string>
#include <string_view>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

/// The matrix and the tables of a review report in Markdown (CommonMark with tables), without
/// charts.
[[nodiscard]] std::string review_markdown(const Review& review);

/// Visible text in one line that Markdown shows as it is: what could be a mark of it is escaped.
[[nodiscard]] std::string markdown_text(std::string_view text);

}  // namespace proofmass::coordinator
