#include "coordinator/report/drawn_runs.hpp"

#include <fmt/format.h>

#include "coordinator/report/digest_check.hpp"
#include "core/campaign/draw.hpp"
#include "core/campaign/run_ranges.hpp"

namespace proofmass::coordinator {

namespace {

std::vector<std::string> column_names() {
  std::vector<std::string> names(drawn_names().begin(), drawn_names().end());
  for (const ParameterInfo& info : parameter_infos()) {
    names.push_back(fmt::format("truth_{}{}", info.name, info.unit_suffix));
  }
  return names;
}

void append(const RunResult& result, const DrawnValues& values, DrawnRuns& drawn) {
  drawn.runs.push_back(result.run);
  for (std::size_t i = 0; i < num_drawn; ++i) drawn.columns[i].push_back(values[i]);
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    drawn.columns[num_drawn + i].push_back(result.truth[i]);
    drawn.errors[i].push_back(result.error(info.parameter));
  }
}

}  // namespace

DrawnRuns read_drawn_runs(const Store& store, const Campaign& campaign, std::uint64_t num_runs_max,
                          std::optional<RunIndex> also) {
  DrawnRuns drawn;
  drawn.names = column_names();
  drawn.columns.resize(drawn.names.size());
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
    require_in_range(result);
    const DrawnValues values = draw_values(campaign.dispersions, campaign.seed, result.run,
                                           result.num_draws - 1, campaign.table_values(result.run));
    append(result, values, drawn);
  });
  return drawn;
}

}  // namespace proofmass::coordinator
