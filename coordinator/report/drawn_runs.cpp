#include "coordinator/report/drawn_runs.hpp"

#include <fmt/format.h>

#include "coordinator/report/digest.hpp"
#include "core/campaign/model.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

std::vector<std::string> column_names() {
  std::vector<std::string> names;
  for (const DrawnQuantity& drawn : model().drawn()) names.emplace_back(drawn.name);
  for (const Quantity& quantity : model().results().quantities) {
    names.push_back("truth_" + quantity.column());
  }
  return names;
}

void append(const RunResult& result, const RunDraw& draw, DrawnRuns& drawn) {
  drawn.runs.push_back(result.run);
  const std::size_t num_drawn = draw.values.size();
  for (std::size_t i = 0; i < num_drawn; ++i) drawn.columns[i].push_back(draw.values[i]);
  for (std::size_t i = 0; i < result.truth.size(); ++i) {
    drawn.columns[num_drawn + i].push_back(result.truth[i]);
    drawn.errors[i].push_back(result.error(i));
  }
}

}  // namespace

DrawnRuns read_drawn_runs(const Store& store, const Campaign& campaign, std::uint64_t num_runs_max,
                          std::optional<RunIndex> also) {
  DrawnRuns drawn;
  drawn.names = column_names();
  drawn.columns.resize(drawn.names.size());
  drawn.errors.resize(model().results().quantities.size());
  drawn.missing.num_given_up = num_runs_in(store.given_up_runs());
  (void)walk_checked(store, [&](const RunResult& result) {
    const bool is_first = drawn.num_first < num_runs_max;
    if (!result.has_estimate()) {
      if (is_first) drawn.missing.add(result);
      return;
    }
    ++drawn.num_with_estimate;
    drawn.last_with_estimate = result.run;
    if (!is_first && result.run != also) return;
    if (is_first) ++drawn.num_first;
    require_in_range(result, model().results());
    const RunDraw draw = campaign.draw(result.run);
    if (draw.values.empty()) {
      store.refuse_as_damaged(fmt::format(
          "run {} has an estimate, and its definition yields no draw", result.run.value));
    }
    append(result, draw, drawn);
  });
  return drawn;
}

}  // namespace proofmass::coordinator
