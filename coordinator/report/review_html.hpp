#pragma once

#include <string>

#include "coordinator/report/review.hpp"
#include "coordinator/report/review_tables.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// The report of a review as one page of HTML, which needs no other file, no network and no script
/// and allows none. It begins with the verification matrix. The same bytes for the same review.
[[nodiscard]] std::string review_html(const Review& review);

/// A table as HTML: a region that scrolls if it is too narrow, with the caption as its name.
[[nodiscard]] std::string html_table(const ReviewTable& table);

/// The style that html_table() and embedded charts need, for a page that shows live_results_html():
/// rules of CSS without their element. Colours are custom properties, for light and dark.
[[nodiscard]] std::string review_style();

/// What a campaign's results tell so far, as a fragment of HTML for a page with review_style(): the
/// accuracy table and the histograms of |error|. Headings are of level 3. For campaigns that are
/// not finished as well; nothing is compared with stored digests, and nothing is written.
///
/// Takes 5 µs of a core for each finished run, 5 s for a million: call it in the background, and
/// not for each viewer.
[[nodiscard]] std::string live_results_html(const Store& store, const Campaign& campaign);

}  // namespace proofmass::coordinator
