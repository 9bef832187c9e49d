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

#include "coordinator/report/report.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using proto::CampaignStatus;
using wire::markup_text;

/// As terminals show it, with a link and a bar.
Row row_of(const CampaignStatus& campaign) {
  Row row = campaign_row(campaign);
  row[0].markup = fmt::format("<a href=\"campaigns/{}\">{}</a>", percent_encoded(campaign.name()),
                              markup_text(campaign.name()));
  row[5].markup = progress_bar(campaign, "progress of " + campaign.name());
  return row;
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

std::string_view name_of(WorkerOrder order) {
  constexpr std::array<std::string_view, 3> names{"name", "state", "throughput"};
  return names.at(static_cast<std::size_t>(order));
}

/// What the parameters `sort`, `filter` and `page` say; unknown values count as absent.
WorkerChoice worker_choice(const PageRequest& request) {
  constexpr std::size_t filter_size_max = 128;
  WorkerChoice choice{.filter = request.text("filter").substr(0, filter_size_max),
                      .page = request.number("page").value_or(1)};
  for (const WorkerOrder order : {WorkerOrder::state, WorkerOrder::throughput}) {
    if (request.text("sort") == name_of(order)) choice.order = order;
  }
  return choice;
}

/// Since the worker registered.
double results_per_h(const RegisteredWorker& worker) {
  if (worker.registered_s <= 0.0) return 0.0;
  return 3600.0 * static_cast<double>(worker.status.num_results()) / worker.registered_s;
}

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
  const PageOfList list = page_of_list(choice.page, chosen.size());
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
  const PageOfList list = page_of_list(request.number("page").value_or(1), campaigns.size());
  Table table{.caption = "Campaigns", .columns = campaign_columns()};
  for (std::size_t i = list.first; i < list.end; ++i) {
    table.rows.push_back(row_of(campaigns[i].status));
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

PageOfList page_of_list(std::size_t page, std::size_t count) {
  constexpr std::size_t num_per_page = 50;
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

std::string fact(std::string_view name, std::string_view value) {
  return fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, value);
}

std::string notes_list(const std::vector<Remark>& notes) {
  if (notes.empty()) return {};
  std::string html = "<ul class=\"notes\">\n";
  for (const Remark& note : notes) html += fmt::format("<li>{}</li>\n", sentence_markup(note.text));
  return html + "</ul>\n";
}

namespace {

// Beside review_style(). The colours have a contrast of 4.5 at least, in both themes.
constexpr std::string_view style = R"css(
header { display: flex; flex-wrap: wrap; gap: 0.4rem 1.4rem; align-items: baseline;
  padding: 0.6rem 1rem; background: var(--heading); border-bottom: 1px solid var(--chart-grid); }
header nav a { display: inline-block; margin-right: 0.9rem; padding: 0.2rem 0; }
#state { margin: 0 0 0 auto; color: var(--faint); font-size: 0.9rem; min-height: 1.3em; }
#state.bad { color: var(--open); background: var(--warn-ground); padding: 0 0.5rem; }
main { max-width: 84rem; margin: 0 auto; padding: 0.5rem 1rem 3rem; }
main:focus { outline: none; }
h2 { font-size: 1.15rem; margin: 1.6rem 0 0.4rem; }
.note { color: var(--faint); }
.notes { background: var(--warn-ground); color: var(--open); border-radius: 4px;
  padding: 0.5rem 0.5rem 0.5rem 1.6rem; overflow-wrap: anywhere; }
.list td, thead th { white-space: nowrap; min-width: 0; }
.list tbody th { min-width: 9rem; }
thead th { color: var(--faint); }
.long { display: inline-block; white-space: normal; min-width: 16rem; max-width: 46rem;
  overflow-wrap: anywhere; }
progress { width: min(8rem, 12vw); height: 0.8rem; accent-color: var(--chart-first);
  vertical-align: middle; }
.large progress { width: min(28rem, 60vw); height: 1.1rem; }
dl { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: 0.6rem;
  margin: 0.8rem 0; }
dl div { background: var(--heading); border-radius: 4px; padding: 0.4rem 0.7rem; }
dt { color: var(--faint); font-size: 0.85rem; }
dd { margin: 0; font-size: 1.15rem; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
form { display: flex; flex-wrap: wrap; gap: 0.5rem 0.8rem; align-items: center; margin: 0.6rem 0; }
input, select, button { font: inherit; color: inherit; background: var(--chart-ground);
  border: 1px solid var(--faint); border-radius: 4px; padding: 0.25rem 0.5rem; max-width: 100%; }
.pages a, .pages span { display: inline-block; padding: 0.25rem 0.5rem; }
.pages .off { color: var(--faint); }
time { white-space: nowrap; }
tbody th:has(time) { position: static; max-width: none; }
)css";

// The new markup is merged into the old element by element, so that focus, scroll positions and
// selected text stay.
constexpr std::string_view script = R"js('use strict';
(() => {
  const live = document.getElementById('live');
  const state = document.getElementById('state');
  const interval = 2000;
  let timer = 0;
  let failing = false;

  const say = (text, isBad) => {
    if (state.textContent !== text) state.textContent = text;
    state.classList.toggle('bad', isBad);
  };

  const mergeAttributes = (old, fresh) => {
    for (const { name } of [...old.attributes]) {
      if (!fresh.hasAttribute(name)) old.removeAttribute(name);
    }
    for (const { name, value } of fresh.attributes) {
      if (old.getAttribute(name) !== value) old.setAttribute(name, value);
    }
  };

  const isAlike = (old, fresh) => old.nodeName === fresh.nodeName &&
    old.className === fresh.className;

  // Notes come and go before a table: what has the focus is never removed to make room for them.
  const merge = (old, fresh) => {
    let there = old.firstChild;
    for (const node of fresh.childNodes) {
      let match = there;
      while (match && !isAlike(match, node)) {
        match = match.contains(document.activeElement) ? null : match.nextSibling;
      }
      if (!match) {
        old.insertBefore(document.importNode(node, true), there);
        continue;
      }
      while (there !== match) {
        there = there.nextSibling;
        there.previousSibling.remove();
      }
      there = match.nextSibling;
      if (node.nodeType === Node.ELEMENT_NODE) {
        mergeAttributes(match, node);
        merge(match, node);
      } else if (match.data !== node.data) {
        match.data = node.data;
      }
    }
    while (there) {
      const next = there.nextSibling;
      there.remove();
      there = next;
    }
  };

  const refresh = async () => {
    const address = new URL(location.href);
    address.hash = '';
    address.searchParams.set('fragment', '1');
    try {
      const signal = AbortSignal.timeout(10000);
      const answer = await fetch(address, { cache: 'no-store', signal });
      if (answer.status === 401) {
        say('This page needs its token again: reload it to see how it is given.', true);
        return;
      }
      if (!answer.ok) throw new Error(String(answer.status));
      const fresh = new DOMParser().parseFromString(await answer.text(), 'text/html');
      merge(live, fresh.body);
      if (failing) say('Connected again.', false);
      failing = false;
    } catch (error) {
      if (!failing) {
        const time = new Date().toLocaleTimeString();
        say('The coordinator cannot be reached since ' + time + '; trying again.', true);
      }
      failing = true;
    }
    schedule();
  };

  const schedule = () => {
    clearTimeout(timer);
    if (!document.hidden) timer = setTimeout(refresh, interval);
  };

  document.addEventListener('visibilitychange', () => {
    clearTimeout(timer);
    if (!document.hidden) refresh();
  });
  schedule();
})();
)js";

}  // namespace

std::optional<HttpAnswer> file_answer(std::string_view name) {
  if (name == "style.css") {
    return HttpAnswer{.content_type = "text/css; charset=utf-8",
                      .body = review_style() + std::string(style)};
  }
  if (name != "script.js") return std::nullopt;
  return HttpAnswer{.content_type = "text/javascript; charset=utf-8", .body = std::string(script)};
}

}  // namespace proofmass::coordinator
