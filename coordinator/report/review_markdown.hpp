#pragma once

#include <string>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

/// The matrix and the tables of a review report in Markdown (CommonMark with tables), without
/// charts.
[[nodiscard]] std::string review_markdown(const Review& review);

}  // namespace proofmass::coordinator
