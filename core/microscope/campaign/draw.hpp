#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/campaign/run_result.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/instrument/instrument.hpp"

namespace proofmass {

/// Most draws of one run; with the nominal laws three of four are accepted. Then: no_draw.
inline constexpr std::uint32_t num_draws_max = 1000;

struct AcceptedDraw {
  std::optional<Instrument> instrument;  ///< Empty if all num_draws_max were rejected.
  std::uint32_t num_draws = 0;           ///< At most num_draws_max.
};

/// True if a_d11, a_d12, a_d13, a_c12 and a_c13 lie inside their bounds.
[[nodiscard]] bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance);

/// Draws the run's instrument, again as a whole until it is accepted.
[[nodiscard]] AcceptedDraw draw_instrument(const MicroscopeCampaign& campaign, RunIndex run,
                                           std::span<const double> table_values);

}  // namespace proofmass
