#include "coordinator/page/page_layout.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/document_table.hpp"
#include "coordinator/table/figures.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string page_link(std::string_view address, std::size_t page, std::string_view text,
                      bool is_active) {
  if (!is_active) return fmt::format("<span class=\"off\">{}</span>", text);
  return fmt::format("<a href=\"{}{}\">{}</a>", address, page, text);
}

}  // namespace

std::string whole_page(const PageContent& content) {
  const std::string title = markup_text(content.title);
  const std::string root = content.to_root.empty() ? "./" : content.to_root;
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<title>{0} – Proofmass</title>\n<link rel=\"stylesheet\" href=\"{1}style.css\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n"
      "<script src=\"{1}script.js\" defer></script>\n</head>\n<body>\n"
      "<a class=\"skip\" href=\"#main\">Skip to the content</a>\n"
      "<header><strong>Proofmass</strong><nav aria-label=\"Pages\"><a href=\"{1}\">Campaigns</a> "
      "<a href=\"{1}workers\">Workers</a></nav>"
      "<p id=\"state\" role=\"status\"></p></header>\n"
      "<main id=\"main\" tabindex=\"-1\">\n<h1>{0}</h1>\n{2}<div id=\"live\">\n{3}</div>\n"
      "<noscript><p class=\"note\">Without JavaScript, reload the page to see the present state."
      "</p></noscript>\n</main>\n</body>\n</html>\n",
      title, root, content.form, content.live);
}

PageOfList page_of_list(std::size_t page, std::size_t count, std::size_t num_per_page) {
  PageOfList list{.count = count};
  list.num_pages = std::max<std::size_t>(1, (count + num_per_page - 1) / num_per_page);
  list.page = std::clamp<std::size_t>(page, 1, list.num_pages);
  list.first = std::min(count, (list.page - 1) * num_per_page);
  list.end = std::min(count, list.first + num_per_page);
  return list;
}

std::string list_navigation(const PageOfList& list, std::string_view things,
                            std::string_view address) {
  if (list.count == 0) return fmt::format("<p class=\"note\">no {}</p>\n", things);
  std::string html =
      fmt::format("<p class=\"note\">showing {}–{} of {} {}</p>\n", grouped(list.first + 1),
                  grouped(list.end), grouped(list.count), things);
  if (list.num_pages == 1) return html;
  const bool has_before = list.page > 1;
  const bool has_after = list.page < list.num_pages;
  return html + fmt::format(
                    "<nav class=\"pages\" aria-label=\"Pages of {}\">{} {} <span>page {} "
                    "of {}</span> {} {}</nav>\n",
                    things, page_link(address, 1, "first", has_before),
                    page_link(address, list.page - 1, "previous", has_before), grouped(list.page),
                    grouped(list.num_pages), page_link(address, list.page + 1, "next", has_after),
                    page_link(address, list.num_pages, "last", has_after));
}

std::string progress_bar(const proto::CampaignStatus& campaign, std::string_view name) {
  return fmt::format(
      "<progress max=\"{}\" value=\"{}\" aria-label=\"{}\"></progress> <span>{}&nbsp;%</span>",
      std::max<std::uint64_t>(1, campaign.num_runs()), campaign.num_done(), markup_text(name),
      percent_done(campaign));
}

std::string rate_text(const proto::CampaignStatus& campaign) {
  return campaign.rate_hz() > 0.0 ? measured_figure(campaign.rate_hz()) : "–";
}

std::string time_left_text(const proto::CampaignStatus& campaign) {
  return campaign.has_remaining_s() ? duration_text(campaign.remaining_s()) : "–";
}

std::string fact(std::string_view name, std::string_view value) {
  return fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, value);
}

std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t place = digits.size(); place > 3; place -= 3) digits.insert(place - 3, 1, ',');
  return digits;
}

std::string notes_list(const std::vector<Remark>& notes) {
  if (notes.empty()) return {};
  std::string html = "<ul class=\"notes\">\n";
  for (const Remark& note : notes) html += fmt::format("<li>{}</li>\n", sentence_markup(note.text));
  return html + "</ul>\n";
}

}  // namespace proofmass::coordinator
