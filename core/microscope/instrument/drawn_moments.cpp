#include "core/microscope/instrument/drawn_moments.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace proofmass {
namespace {

constexpr auto num_values = static_cast<Eigen::Index>(num_drawn);

/// Means and covariances of fixed draws. A draw with a value out of range would be taken again.
/// @param known  Without tables.
DrawnMoments sampled_moments(const DispersionSet& known, std::uint64_t num_draws) {
  constexpr std::uint64_t key = 1;
  std::vector<Eigen::VectorXd> samples;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(num_values);
  for (std::uint64_t i = 0; i < num_draws; ++i) {
    const DrawnValues values = draw_values(known, key, RunIndex{i}, 0, {});
    if (!is_drawn_in_range(known, values)) continue;
    samples.emplace_back(Eigen::Map<const Eigen::VectorXd>(values.data(), num_values));
    mean += samples.back();
  }
  DrawnMoments moments{.mean = {}, .covariance = Eigen::MatrixXd::Zero(num_values, num_values)};
  if (samples.empty()) return moments;  // No run has a draw.
  const double part = 1.0 / static_cast<double>(samples.size());
  mean *= part;
  for (const Eigen::VectorXd& sample : samples) {
    const Eigen::VectorXd distance = sample - mean;
    moments.covariance += part * distance * distance.transpose();
  }
  std::copy_n(mean.data(), num_drawn, moments.mean.begin());
  return moments;
}

/// Those that follow from each law alone, and the correlations that laws name.
DrawnMoments moments_of_laws(const DispersionSet& known) {
  DrawnMoments moments{.mean = {}, .covariance = Eigen::MatrixXd::Zero(num_values, num_values)};
  DrawnValues deviation{};
  for (std::size_t i = 0; i < num_drawn; ++i) {
    const LawMoments of_law = moments_of(known[i]).value_or(LawMoments{});
    const auto row = static_cast<Eigen::Index>(i);
    moments.mean[i] = of_law.mean;
    deviation[i] = of_law.standard_deviation;
    moments.covariance(row, row) = deviation[i] * deviation[i];
    if (known[i].law != Law::correlated) continue;
    for (std::size_t k = 0; k < known[i].with.size(); ++k) {
      // It comes before this one.
      const auto with = std::ranges::find(drawn_names(), known[i].with[k]) - drawn_names().begin();
      const double covariance =
          known[i].correlations[k] * deviation[i] * deviation[static_cast<std::size_t>(with)];
      moments.covariance(row, with) = moments.covariance(with, row) = covariance;
    }
  }
  return moments;
}

}  // namespace

DrawnMoments drawn_moments(const DispersionSet& dispersions, std::uint64_t num_draws) {
  DispersionSet known = dispersions;
  const DispersionSet nominal = nominal_dispersions();
  for (const std::size_t i : table_elements(dispersions)) known[i] = nominal[i];
  const DrawnMoments of_laws = moments_of_laws(known);
  if (std::ranges::find(known, Law::derived, &Dispersion::law) == known.end()) return of_laws;

  // Sampled covariances of all quantities are positive definite together. Those of quantities that
  // are not derived get the deviation of their law, for the sake of values that are rare.
  DrawnMoments moments = sampled_moments(known, num_draws);
  for (std::size_t i = 0; i < num_drawn; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double sampled = moments.covariance(row, row);
    if (known[i].law == Law::derived) continue;
    moments.mean[i] = of_laws.mean[i];
    const double factor = sampled > 0.0 ? std::sqrt(of_laws.covariance(row, row) / sampled) : 0.0;
    moments.covariance.row(row) *= factor;
    moments.covariance.col(row) *= factor;
    moments.covariance(row, row) = of_laws.covariance(row, row);
  }
  return moments;
}

}  // namespace proofmass
