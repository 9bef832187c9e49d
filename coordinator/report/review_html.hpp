#pragma once

#include <string>

#include "coordinator/report/review.hpp"

namespace proofmass::coordinator {

/// The report of a review as one page of HTML, which needs no other file, no network and no script
/// and allows none. It begins with the verification matrix. The same bytes for the same review.
[[nodiscard]] std::string review_html(const Review& review);

/// What a campaign's results tell so far, as a fragment of HTML for a page with review_style(): the
/// accuracy table and the histograms of |error|. Headings are of level 3.
/// @param review  Of read_live_review().
[[nodiscard]] std::string live_results_html(const Review& review);

}  // namespace proofmass::coordinator
