#include "core/microscope/campaign/draw.hpp"

#include <cmath>

namespace proofmass {

bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance) {
  const auto [a_c, a_d] = sensitivity_matrices(instrument);
  return std::abs(a_d(0, 0)) <= acceptance.a_d11_max &&
         std::abs(a_d(0, 1)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_d(0, 2)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_c(0, 1)) <= acceptance.a_c1j_max_rad &&
         std::abs(a_c(0, 2)) <= acceptance.a_c1j_max_rad;
}

AcceptedDraw draw_instrument(const MicroscopeCampaign& campaign, RunIndex run,
                             std::span<const double> table_values) {
  AcceptedDraw draw;
  while (draw.num_draws < num_draws_max) {
    const Instrument instrument = make_instrument(
        draw_values(campaign.dispersions, campaign.seed, run, draw.num_draws, table_values));
    ++draw.num_draws;
    if (is_accepted(instrument, campaign.scenario.acceptance)) {
      draw.instrument = instrument;
      break;
    }
  }
  return draw;
}

}  // namespace proofmass
