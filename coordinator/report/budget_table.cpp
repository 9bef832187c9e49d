#include <fmt/format.h>

#include <array>
#include <optional>

#include "coordinator/report/report.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t term_width = 23;
constexpr std::size_t figure_width = 9;
constexpr std::size_t side_width = 3 * figure_width + 1;  // A space before the line between.

// Contributions before calibration and after it, with the worst and the mean errors.
using Figures = std::array<std::optional<double>, 3>;

std::string cells(const Figures& figures) {
  std::string text;
  for (const std::optional<double>& figure : figures) {
    text += right_aligned(figure ? fmt::format("{:.1e}", *figure) : "-", figure_width);
  }
  return text;
}

std::string row(const BudgetEntryInfo& info, const Figures& figures) {
  const Figures paper{info.paper_before, info.paper_after_worst, info.paper_after_mean};
  return left_aligned(info.label, term_width) + cells(figures) + " │" + cells(paper) + "\n";
}

std::string rule() {
  return horizontal_rule(term_width + side_width) + "┼" + horizontal_rule(side_width - 1) + "\n";
}

std::string heading() {
  std::string titles;
  for (const char* title : {"before", "worst", "mean"}) {
    titles += right_aligned(title, figure_width);
  }
  return std::string(term_width, ' ') +
         left_aligned(centred("this campaign", side_width), side_width) + "│" +
         centred("the paper", side_width) + "\n" + left_aligned("term", term_width) + titles +
         " │" + titles + "\n" + rule();
}

// The paper adds up the worst errors of all parameters, which no single run has.
std::string totals_text(const RunTotals& totals) {
  return fmt::format(
      "worst adds up the worst errors of different runs, as the paper does; totals of\n"
      "single runs: median {:.1e}, 95 % below {:.1e}, worst {:.1e} (run {})\n",
      totals.median, totals.percentile_95, totals.worst, totals.worst_run.value);
}

}  // namespace

std::string budget_table(const Campaign& campaign, const CampaignStatistics& statistics,
                         const std::optional<RunTotals>& totals) {
  const std::optional<ErrorBudget> budget = campaign.error_budget();
  if (!budget) return "";
  const bool has_errors = statistics.num_estimated > 0;
  const Budget after_worst = has_errors ? budget->after(statistics.worst_errors()) : Budget{};
  const Budget after_mean = has_errors ? budget->after(statistics.mean_errors()) : Budget{};
  const auto figures = [&](const auto& value_of) -> Figures {
    if (!has_errors) return {value_of(budget->before), std::nullopt, std::nullopt};
    return {value_of(budget->before), value_of(after_worst), value_of(after_mean)};
  };
  std::string text = fmt::format("{}\n\n{}", budget->title, heading());
  for (std::size_t i = 0; i < budget->infos.size(); ++i) {
    text += row(budget->infos[i], figures([&](const Budget& of) { return of.entries[i]; }));
  }
  text += rule() + row(budget->total_info, figures([](const Budget& of) { return of.total; }));
  text += "before: bounds of construction; worst, mean: left by the errors of calibration\n";
  text += budget->note;
  return totals ? text + totals_text(*totals) : text;
}

}  // namespace proofmass::coordinator
