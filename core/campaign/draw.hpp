#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/instrument/instrument.hpp"

namespace proofmass {

struct AcceptedDraw {
  std::optional<Instrument> instrument;  ///< Empty if all num_draws_max were rejected.
  std::uint32_t num_draws = 0;           ///< At most num_draws_max.
};

/// True if a_d11, a_d12, a_d13, a_c12 and a_c13 lie inside their bounds.
[[nodiscard]] bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance);

/// Draws the run's instrument, again as a whole until it is accepted.
[[nodiscard]] AcceptedDraw draw_instrument(const Campaign& campaign, RunIndex run,
                                           std::span<const double> table_values);

}  // namespace proofmass
