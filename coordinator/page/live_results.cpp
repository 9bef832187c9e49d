#include "coordinator/page/live_results.hpp"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string accuracy_cells(const AccuracyStatistic& accuracy, double scale,
                           std::uint64_t num_runs) {
  if (num_runs == 0) return "<td>–</td><td>–</td><td>–</td><td>–</td>";
  return fmt::format("<td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
                     measured_figure(accuracy.worst / scale),
                     measured_figure(accuracy.mean / scale),
                     num_runs < 2 ? "–" : measured_figure(accuracy.standard_deviation / scale),
                     accuracy.num_beyond_objective);
}

std::string accuracy_line(const Quantity& quantity, double objective,
                          const AccuracyStatistic& accuracy, std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  return fmt::format("<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td><td>{}</td>{}</tr>\n",
                     markup_text(quantity.symbol), markup_text(quantity.display_unit),
                     std::isfinite(objective) ? given_figure(objective / scale) : "–",
                     accuracy_cells(accuracy, scale, num_runs));
}

}  // namespace

std::string live_results_html(const Store& store, const Campaign& campaign) {
  std::string html;
  store.read_one_state([&] {
    const CampaignStatistics statistics = read_checked_results(store, campaign).results.statistics;
    const std::uint64_t num_runs = statistics.num_estimated;
    html = fmt::format(
        "<section><h2>Accuracy</h2>\n<p>|estimate − truth| of {} runs with an estimate</p>\n"
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Accuracy\"><table>"
        "<thead><tr><th scope=\"col\" class=\"text\">parameter</th><th scope=\"col\" "
        "class=\"text\">unit</th><th scope=\"col\">objective</th><th scope=\"col\">worst</th>"
        "<th scope=\"col\">mean</th><th scope=\"col\">std</th><th scope=\"col\">beyond</th></tr>"
        "</thead>\n<tbody>\n",
        num_runs);
    const std::vector<double> objectives = campaign.objectives();
    const std::vector<Quantity>& quantities = model().results().quantities;
    for (std::size_t i = 0; i < quantities.size(); ++i) {
      html += accuracy_line(quantities[i], objectives[i],
                            num_runs > 0 ? statistics.accuracy[i] : AccuracyStatistic{}, num_runs);
    }
    html +=
        "</tbody></table></div>\n<p class=\"note\">beyond: runs whose error exceeds the objective"
        "</p></section>\n";
  });
  return html;
}

}  // namespace proofmass::coordinator
