#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass::test {

/// Amplitudes of the session's lines in a record, first those that it fits, as [Hardy2013] section
/// 5.2 reads: remove the mean, band-pass, drop the transient, least squares on cosine and sine of
/// all lines.
///
/// @param other_filter  In place of the band-pass about the lines that the session fits.
inline std::vector<std::complex<double>> fitted_lines(std::span<const double> record,
                                                      const Scenario& scenario,
                                                      const Session& session,
                                                      std::optional<BandPass> other_filter = {}) {
  const double period_s = scenario.simulation.sample_period_s;
  std::vector<double> lines_hz;
  for (const auto* const lines : {&session.fit_lines, &session.known_lines}) {
    for (const LineMultiple& line : *lines) {
      lines_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
    }
  }
  double centre_hz = 0.0;
  for (std::size_t i = 0; i < session.fit_lines.size(); ++i) centre_hz += lines_hz[i];
  centre_hz /= static_cast<double>(session.fit_lines.size());
  const double ratio = scenario.estimation.band_ratio;
  const BandPass filter =
      other_filter.value_or(band_pass(centre_hz / ratio, centre_hz * ratio, period_s));

  double mean = 0.0;
  for (const double value : record) mean += value;
  mean /= static_cast<double>(record.size());
  const auto num_dropped =
      static_cast<std::size_t>(std::ceil(scenario.estimation.transient_s / period_s));
  const auto num_kept = static_cast<Eigen::Index>(record.size() - num_dropped);
  const auto num_lines = static_cast<Eigen::Index>(lines_hz.size());
  Eigen::VectorXd kept(num_kept);
  Eigen::MatrixXd design(num_kept, 2 * num_lines);
  BandPassState state;
  for (std::size_t k = 0; k < record.size(); ++k) {
    const double value = state.advance(filter, record[k] - mean);
    if (k < num_dropped) continue;
    const auto row = static_cast<Eigen::Index>(k - num_dropped);
    kept(row) = value;
    for (Eigen::Index i = 0; i < num_lines; ++i) {
      const double phase = 2.0 * std::numbers::pi * lines_hz[static_cast<std::size_t>(i)] *
                           static_cast<double>(k) * period_s;
      design(row, 2 * i) = std::cos(phase);
      design(row, 2 * i + 1) = std::sin(phase);
    }
  }
  const Eigen::VectorXd amplitudes = design.householderQr().solve(kept);
  std::vector<std::complex<double>> lines;
  for (Eigen::Index i = 0; i < num_lines; ++i) {
    lines.emplace_back(amplitudes(2 * i), amplitudes(2 * i + 1));
  }
  return lines;
}

}  // namespace proofmass::test
