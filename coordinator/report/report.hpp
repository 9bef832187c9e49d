#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "coordinator/report/review.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

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

}  // namespace proofmass::coordinator
