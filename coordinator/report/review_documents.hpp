#pragma once

#include <string>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

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

}  // namespace proofmass::coordinator
