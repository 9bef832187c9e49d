#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

/// The parts of a page of the live page.
struct PageContent {
  std::string title = {};    ///< Plain text; becomes the heading, too.
  std::string to_root = "";  ///< From the page's address to the first page: ``, or `../`.
  std::string form = "";     ///< Markup above `live`, which the script does not exchange.
  std::string live = {};     ///< Markup that the script exchanges every two seconds.
};

/// A whole page.
[[nodiscard]] std::string whole_page(const PageContent& content);

/// Part of a list that is shown: pages count from 1.
struct PageOfList {
  std::size_t page = 1;
  std::size_t num_pages = 1;
  std::size_t first = 0;  ///< Index of the first item shown.
  std::size_t end = 0;    ///< One beyond the last.
  std::size_t count = 0;  ///< Of all.
};

/// The page that was asked for, or the last one if there are not so many.
[[nodiscard]] PageOfList page_of_list(std::size_t page, std::size_t count,
                                      std::size_t num_per_page);

/// `showing 1–50 of 10,000 workers`, and links to the first, previous, next and last page.
/// @param address  Of a page, without its number: `workers?sort=name&amp;page=`; markup.
[[nodiscard]] std::string list_navigation(const PageOfList& list, std::string_view things,
                                          std::string_view address);

/// A bar of the finished runs with its percentage in words.
/// @param name  Of the bar, for screen readers.
[[nodiscard]] std::string progress_bar(const proto::CampaignStatus& campaign,
                                       std::string_view name);

/// Runs a second, and the time until all are finished; dashes where they are not known.
[[nodiscard]] std::string rate_text(const proto::CampaignStatus& campaign);
[[nodiscard]] std::string time_left_text(const proto::CampaignStatus& campaign);

/// A name with what it has, as a part of a `<dl>`.
[[nodiscard]] std::string fact(std::string_view name, std::string_view value);

/// `1,234,567`
[[nodiscard]] std::string grouped(std::uint64_t count);

/// A list of notes; nothing if there are none.
[[nodiscard]] std::string notes_list(const std::vector<Remark>& notes);

/// The style sheet and the script of all pages.
[[nodiscard]] std::string page_style();
[[nodiscard]] std::string_view page_script();

}  // namespace proofmass::coordinator
