#pragma once

#include <string>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// The accuracy of each parameter as sections of a page, computed from the results in the file so
/// far.
/// @throws StoreError as report_text() does.
[[nodiscard]] std::string live_results_html(const Store& store, const Campaign& campaign);

}  // namespace proofmass::coordinator
