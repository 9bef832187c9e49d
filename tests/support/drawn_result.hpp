#pragma once

#include <utility>

#include "tests/support/microscope_results.hpp"

namespace proofmass::test {

/// What a run of the default campaign begins with, whatever its number of runs.
inline RunDraw default_draw(RunIndex run) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs_max;
  return campaign.draw(run);
}

/// As zero_result(), but with the draw of the default campaign: a coordinator may look at that.
inline RunResult drawn_result(RunResult result) {
  result = zero_result(std::move(result));
  if (!result.has_truth()) return result;
  RunDraw draw = default_draw(result.run);
  result.num_draws = draw.num_draws;
  result.truth = std::move(draw.truth);
  return result;
}

}  // namespace proofmass::test
