#include "coordinator/report/review.hpp"

#include <algorithm>
#include <utility>

#include "coordinator/report/summarise.hpp"
#include "core/campaign/independence.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

Review read_of_one_state(const Store& store, const Campaign& campaign, ReviewDepth depth,
                         std::vector<StatedRequirement> stated) {
  Review review{.name = store.name(),
                .seed = store.seed(),
                .num_runs = store.num_runs(),
                .model_version = store.model_version(),
                .is_of_program = !store.model().description().empty(),
                .is_imported = store.model().is_imported(),
                .note = campaign.note(),
                .build = store.build(),
                .created_utc = store.created_utc(),
                .definition_digest = store.table_digest(),
                .schema = store.schema(),
                .objectives = campaign.objectives(),
                .interpretation = campaign.interpretation(),
                .budget = campaign.error_budget(),
                .why_not_independent = why_not_independent(campaign)};
  if (depth == ReviewDepth::tables) {
    review.results = read_checked_results(store, campaign);
    return review;
  }
  ErrorFigures figures(review.objectives.size(), num_runs_in(store.finished_runs()));
  VerificationMatrix matrix(store.schema(), std::move(stated), review.objectives,
                            num_runs_in(store.given_up_runs()), store.num_runs_fixed(),
                            review.budget);
  review.results = read_checked_results(
      store, campaign,
      {.result =
           [&](const RunResult& result) {
             if (depth >= ReviewDepth::charts) figures.add(result);
             matrix.add(result);
           },
       .magnitudes = [&](std::size_t quantity,
                         auto magnitudes) { matrix.add_magnitudes(quantity, magnitudes); }});
  review.matrix = matrix.answers();
  if (depth == ReviewDepth::matrix) return review;
  review.execution = store.execution();
  review.figures = figures.figures();
  if (!review.why_not_independent.empty()) {
    for (QuantityFigures& quantity : review.figures) leave_out_intervals(quantity);
  } else if (depth == ReviewDepth::causes) {
    review.causes = find_causes(store, campaign);
  }
  return review;
}

}  // namespace

std::optional<RunIndex> worst_run_of(const Review& review) {
  for (const RequirementAnswer& row : review.matrix) {
    if (row.is_joint() && row.worst) return row.worst->run;
  }
  return std::nullopt;
}

const RequirementAnswer& answer_to(const StatedRequirement& stated, const Review& review) {
  return *std::ranges::find(review.matrix, stated.id,
                            [](const auto& row) { return row.stated.id; });
}

Review read_review(const Store& store, const Campaign& campaign, ReviewDepth depth,
                   std::vector<StatedRequirement> stated) {
  Review review;
  if (!stated.empty()) require_independent(campaign, "requirement", stated.front().requirement);
  stated = matrix_requirements(store.schema(), std::move(stated), campaign.objectives());
  store.read_one_state([&] {
    review = read_of_one_state(store, campaign, depth, std::move(stated));
    review.stop = stop_outcome(store);
  });
  return review;
}

}  // namespace proofmass::coordinator
