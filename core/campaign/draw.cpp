#include "core/campaign/draw.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/error.hpp"
#include "core/random/normal.hpp"
#include "core/random/stream.hpp"

namespace proofmass {
namespace {

/// Trials that one draw of a truncated normal may take. Validation keeps the mean inside the
/// interval and the standard deviation below 100 widths, so one trial succeeds with 0.4 % at least,
/// and all of them fail with less than 1e-7.
constexpr std::uint32_t blocks_per_draw = 4096;

double draw_truncated(const Dispersion& law, const RandomStream& stream,
                      std::uint32_t first_block) {
  for (std::uint32_t i = 0; i < blocks_per_draw; ++i) {
    const double value =
        law.mean + law.standard_deviation * inverse_normal(uniform(stream.block(first_block + i)));
    if (value >= law.minimum && value <= law.maximum) return value;
  }
  // All trials failed: the bound on the probability stands above.
  return std::fmin(std::fmax(law.mean, law.minimum), law.maximum);
}

}  // namespace

DrawnValues draw_values(const DispersionSet& dispersions, std::uint64_t seed, RunIndex run,
                        std::uint32_t draw, std::span<const double> table_values) {
  DrawnValues values{};
  std::size_t next_table_value = 0;
  for (std::size_t i = 0; i < num_drawn; ++i) {
    const Dispersion& law = dispersions[i];
    const RandomStream stream(seed, run, stream_id(fmt::format("draw/{}", drawn_names()[i])));
    const std::uint32_t block = draw * blocks_per_draw;
    switch (law.law) {
      case Law::uniform:
        values[i] = law.minimum + (law.maximum - law.minimum) * uniform(stream.block(block));
        break;
      case Law::normal:
        values[i] =
            law.mean + law.standard_deviation * inverse_normal(uniform(stream.block(block)));
        break;
      case Law::truncated_normal:
        values[i] = draw_truncated(law, stream, block);
        break;
      case Law::fixed:
        values[i] = law.value;
        break;
      case Law::table:
        PROOFMASS_EXPECT(next_table_value < table_values.size());
        values[i] = table_values[next_table_value++];
        break;
    }
  }
  return values;
}

bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance) {
  const auto [a_c, a_d] = sensitivity_matrices(instrument);
  return std::abs(a_d(0, 0)) <= acceptance.a_d11_max &&
         std::abs(a_d(0, 1)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_d(0, 2)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_c(0, 1)) <= acceptance.a_c1j_max_rad &&
         std::abs(a_c(0, 2)) <= acceptance.a_c1j_max_rad;
}

AcceptedDraw draw_instrument(const Campaign& campaign, RunIndex run,
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
