#pragma once

#include "core/microscope/estimation/methods.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass {

/// The filter behind which a session's further lines are recorded: a low-pass at band_ratio times
/// the highest of them and of their neighbours, but at half of the Nyquist frequency at most. It
/// keeps fast noise from leaking into the lines. There is no high-pass: what it would make of an
/// excitation as the record begins lasts for hours, and no line fits it.
[[nodiscard]] BandPass further_lines_filter(const RecordNeeds& needs, const Session& session,
                                            const EstimationConfig& config, double orbit_period_s,
                                            double sample_period_s);

}  // namespace proofmass
