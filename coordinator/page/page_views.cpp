#include "coordinator/page/page_views.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/document_table.hpp"
#include "coordinator/table/figures.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using proto::CampaignStatus;
using wire::markup_text;

Cell campaign_link(const CampaignStatus& campaign) {
  Cell cell(campaign.name());
  cell.markup = fmt::format("<a href=\"campaigns/{}\">{}</a>", percent_encoded(campaign.name()),
                            markup_text(campaign.name()));
  return cell;
}

Cell progress_cell(const CampaignStatus& campaign) {
  Cell cell("");
  cell.markup = progress_bar(campaign, "progress of " + campaign.name());
  return cell;
}

std::string title_of(const ServiceSnapshot& snapshot) {
  std::set<std::string> versions;
  for (const CampaignRecord& campaign : snapshot.campaigns) {
    versions.insert(campaign.status.model_version());
  }
  return fmt::format("<p>{}</p>\n", markup_text(service_line(snapshot.status, versions)));
}

/// The line that screen readers announce when it changes: it must not change often.
std::string summary_line(const ServiceSnapshot& snapshot) {
  std::uint64_t num_active = 0;
  for (const CampaignRecord& campaign : snapshot.campaigns) {
    if (campaign.status.phase() == proto::CAMPAIGN_PHASE_ACTIVE) ++num_active;
  }
  const proto::StatusReply& status = snapshot.status;
  return fmt::format("<p aria-live=\"polite\">{} to compute, {} with {}</p>\n",
                     counted(num_active, "campaign"), counted(status.num_workers(), "worker"),
                     counted(status.num_slots(), "slot"));
}

std::string age_line(TimePoint taken_at, TimePoint now) {
  const double age_s = seconds(now - taken_at);
  if (age_s < 10.0) return {};
  return notes_list(
      {{fmt::format("the coordinator has not answered for {}: this is what it said then",
                    duration_text(age_s))}});
}

std::size_t page_number(const PageRequest& request, const std::string& parameter) {
  return request.number(parameter).value_or(1);
}

std::vector<Remark> overview_notes(const ServiceSnapshot& service, const PageOfList& list) {
  std::vector<Remark> notes = service_notes(service.status);
  for (std::size_t i = list.first; i < list.end; ++i) {
    const CampaignStatus& campaign = service.campaigns[i].status;
    for (const Remark& note : notes_about(campaign)) {
      notes.push_back({campaign.name() + ": " + note.text, note.tone});
    }
  }
  return notes;
}

// Workers.

/// In the order of worker_activities: those that need a look come first.
int place_of(WorkerActivity activity) {
  constexpr std::array places{2, 3, 1, 0};
  return places.at(static_cast<std::size_t>(activity));
}

bool comes_before(const RegisteredWorker& a, const RegisteredWorker& b, WorkerOrder order) {
  const auto key = [](const RegisteredWorker& worker) {
    return std::pair<std::string_view, std::uint64_t>(worker.status.name(),
                                                      worker.status.worker_id());
  };
  if (order == WorkerOrder::state && a.activity != b.activity) {
    return place_of(a.activity) < place_of(b.activity);
  }
  if (order == WorkerOrder::throughput) {
    const double a_rate = results_per_h(a), b_rate = results_per_h(b);
    if (a_rate > b_rate || a_rate < b_rate) return a_rate > b_rate;
  }
  return key(a) < key(b);
}

std::string sort_link(const WorkerChoice& choice, WorkerOrder order, std::string_view text) {
  if (choice.order == order) return std::string(text);
  return fmt::format("<a href=\"workers?sort={}&amp;filter={}\">{}</a>", name_of(order),
                     percent_encoded(choice.filter), text);
}

std::vector<Column> worker_columns_of(const WorkerChoice& choice) {
  const auto column = [&](WorkerOrder order, std::string_view text, std::string_view direction) {
    return Column{.title = std::string(text),
                  .is_text = order != WorkerOrder::throughput,
                  .sort = choice.order == order ? std::string(direction) : std::string(),
                  .markup = sort_link(choice, order, text)};
  };
  return {column(WorkerOrder::name, "worker", "ascending"),
          {"host", true},
          column(WorkerOrder::state, "state", "ascending"),
          {"slots"},
          {"lent"},
          {"results"},
          column(WorkerOrder::throughput, "results/h", "descending"),
          {"heard"},
          {"process"}};
}

std::string rate_figure(double rate) {
  return rate < 1000.0 ? measured_figure(rate)
                       : grouped(static_cast<std::uint64_t>(std::round(rate)));
}

Row worker_row(const RegisteredWorker& worker) {
  const proto::WorkerStatus& status = worker.status;
  return {status.name(),
          status.cards().empty() ? status.host() : status.host() + " with " + status.cards(),
          name_of(worker.activity),
          grouped(status.num_slots()),
          grouped(status.num_lent()),
          grouped(status.num_results()),
          rate_figure(results_per_h(worker)),
          fmt::format("{} ago", duration_text(status.silent_s())),
          std::to_string(status.process_id())};
}

std::string worker_counts(const ServiceSnapshot& service) {
  std::string html = "<dl>";
  for (std::size_t i = 0; i < worker_activities.size(); ++i) {
    html += fact(name_of(worker_activities[i]), grouped(service.num_workers_by_activity[i]));
  }
  return html + "</dl>\n";
}

std::string filter_form(const WorkerChoice& choice) {
  return fmt::format(
      "<form action=\"workers\" method=\"get\" role=\"search\"><label for=\"filter\">Name or host "
      "contains</label> <input id=\"filter\" name=\"filter\" value=\"{}\" maxlength=\"128\">"
      "<input type=\"hidden\" name=\"sort\" value=\"{}\"> <button>Show</button></form>\n",
      markup_text(choice.filter), name_of(choice.order));
}

}  // namespace

std::string_view name_of(WorkerOrder order) {
  constexpr std::array<std::string_view, 3> names{"name", "state", "throughput"};
  return names.at(static_cast<std::size_t>(order));
}

WorkerChoice worker_choice(const PageRequest& request) {
  constexpr std::size_t filter_size_max = 128;
  WorkerChoice choice{.filter = request.text("filter").substr(0, filter_size_max),
                      .page = page_number(request, "page")};
  for (const WorkerOrder order : {WorkerOrder::state, WorkerOrder::throughput}) {
    if (request.text("sort") == name_of(order)) choice.order = order;
  }
  return choice;
}

double results_per_h(const RegisteredWorker& worker) {
  if (worker.registered_s <= 0.0) return 0.0;
  return 3600.0 * static_cast<double>(worker.status.num_results()) / worker.registered_s;
}

ChosenWorkers choose_workers(const std::vector<RegisteredWorker>& workers,
                             const WorkerChoice& choice) {
  std::vector<const RegisteredWorker*> chosen;
  chosen.reserve(workers.size());
  for (const RegisteredWorker& worker : workers) {
    const bool is_wanted = choice.filter.empty() ||
                           worker.status.name().find(choice.filter) != std::string::npos ||
                           worker.status.host().find(choice.filter) != std::string::npos;
    if (is_wanted) chosen.push_back(&worker);
  }
  const PageOfList list = page_of_list(choice.page, chosen.size(), rows_per_page);
  const auto before = [&](const RegisteredWorker* a, const RegisteredWorker* b) {
    return comes_before(*a, *b, choice.order);
  };
  // Only those of the page are sorted.
  const auto first = chosen.begin() + static_cast<std::ptrdiff_t>(list.first);
  const auto end = chosen.begin() + static_cast<std::ptrdiff_t>(list.end);
  std::nth_element(chosen.begin(), first, chosen.end(), before);
  std::partial_sort(first, end, chosen.end(), before);
  return {.list = list, .workers = {first, end}};
}

PageContent overview_page(const ServiceSnapshot& snapshot, const PageRequest& request,
                          TimePoint now) {
  const std::vector<CampaignRecord>& campaigns = snapshot.campaigns;
  const PageOfList list =
      page_of_list(page_number(request, "page"), campaigns.size(), rows_per_page);
  Table table{.caption = "Campaigns",
              .columns = {{"campaign", true},
                          {"phase", true},
                          {"progress", true},
                          {"done"},
                          {"runs"},
                          {"runs/s"},
                          {"time left"},
                          {"priority"}}};
  for (std::size_t i = list.first; i < list.end; ++i) {
    const CampaignStatus& campaign = campaigns[i].status;
    table.rows.push_back({campaign_link(campaign), wire::phase_name(campaign),
                          progress_cell(campaign), grouped(campaign.num_done()),
                          grouped(campaign.num_runs()), rate_text(campaign),
                          time_left_text(campaign), std::to_string(campaign.priority())});
  }
  return {.title = "Campaigns",
          .live = title_of(snapshot) + summary_line(snapshot) + age_line(snapshot.taken_at, now) +
                  notes_list(overview_notes(snapshot, list)) + table_or_nothing(table) +
                  list_navigation(list, "campaigns", "./?page=")};
}

PageContent workers_page(const ServiceSnapshot& snapshot, const PageRequest& request,
                         TimePoint now) {
  const WorkerChoice choice = worker_choice(request);
  const ChosenWorkers chosen = choose_workers(snapshot.workers, choice);
  Table table{.caption = "Workers", .columns = worker_columns_of(choice)};
  for (const RegisteredWorker* worker : chosen.workers) table.rows.push_back(worker_row(*worker));
  const std::string address =
      fmt::format("workers?sort={}&amp;filter={}&amp;page=", name_of(choice.order),
                  percent_encoded(choice.filter));
  return {.title = "Workers",
          .form = filter_form(choice),
          .live = summary_line(snapshot) + age_line(snapshot.taken_at, now) +
                  worker_counts(snapshot) + table_or_nothing(table) +
                  list_navigation(chosen.list, "workers", address) +
                  "<p class=\"note\">results/h: since the worker registered with this coordinator"
                  "</p>\n"};
}

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
