#include "coordinator/archive/several_comparison.hpp"

#include <memory>
#include <utility>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/store/store.hpp"
#include "core/error.hpp"
#include "core/runs.hpp"
#include "core/statistics/error_change.hpp"

namespace proofmass::coordinator {
namespace {

/// @pre One state of the file is read.
ComparedMember member_of(const Store& store, const std::filesystem::path& file) {
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  CheckedResults checked = read_checked_results(store, *campaign);
  const CampaignStatistics& statistics = checked.results.statistics;
  const MissingEstimates missing{.num_not_converged = statistics.num_not_converged,
                                 .num_not_finite = statistics.num_not_finite,
                                 .num_no_draw = statistics.num_no_draw,
                                 .num_lost = statistics.num_lost,
                                 .num_given_up = num_runs_in(checked.given_up)};
  return {.file = file,
          .num_runs = store.num_runs(),
          .statistics = std::move(checked.results.statistics),
          .digest = checked.results.digests.results,
          .missing = missing,
          .objectives = campaign->objectives(),
          .comparison = std::nullopt};
}

}  // namespace

std::vector<ComparedMember> compare_several(std::span<const std::filesystem::path> files,
                                            const IsStopped& is_stopped) {
  PROOFMASS_EXPECT(files.size() >= 2);
  std::vector<ComparedMember> members;
  const Store first = Store::open_read_only(files.front());
  first.read_one_state([&] {
    members.push_back(member_of(first, files.front()));
    for (const std::filesystem::path& file : files.subspan(1)) {
      const Store other = Store::open_read_only(file);
      other.read_one_state([&] {
        members.push_back(member_of(other, file));
        members.back().comparison =
            compare_campaigns(read_compared(first, is_stopped), read_compared(other, is_stopped));
      });
    }
  });
  adjust_together(members);
  return members;
}

void adjust_together(std::span<ComparedMember> members) {
  std::vector<ParameterComparison*> compared;
  std::vector<ChangePValues> p_values;
  for (ComparedMember& member : members) {
    if (!member.comparison || !member.comparison->why_not_compared.empty()) continue;
    for (ParameterComparison& parameter : member.comparison->parameters) {
      compared.push_back(&parameter);
      p_values.push_back(parameter.p_values);
    }
  }
  const std::vector<ChangePValues> adjusted = adjusted_changes(p_values);
  for (std::size_t i = 0; i < compared.size(); ++i) compared[i]->adjusted_p_values = adjusted[i];
}

}  // namespace proofmass::coordinator
