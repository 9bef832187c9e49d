#include "core/microscope/instrument/drawn_sizes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/microscope/instrument/drawn_moments.hpp"

namespace proofmass {
namespace {

double size_of(const DispersionSet& dispersions, const DrawnMoments& moments,
               std::size_t quantity) {
  const Dispersion& law = dispersions[quantity];
  switch (law.law) {
    case Law::uniform:
    case Law::truncated:
    case Law::truncated_normal:
      return std::max(std::abs(law.minimum), std::abs(law.maximum));
    case Law::normal:
    case Law::correlated:
      return std::abs(law.mean) + 3.0 * law.standard_deviation;
    case Law::fixed:
      return std::abs(law.value);
    case Law::discrete:
      return std::abs(
          *std::ranges::max_element(law.values, {}, [](double value) { return std::abs(value); }));
    case Law::derived:
      return std::abs(moments.mean[quantity]) +
             3.0 * std::sqrt(moments.covariance.diagonal()[static_cast<Eigen::Index>(quantity)]);
    case Law::table:
      return size_of(nominal_dispersions(), moments, quantity);
  }
  return 0.0;
}

}  // namespace

DrawnSizes::DrawnSizes(const DispersionSet& dispersions,
                       const std::vector<std::vector<double>>& table_columns) {
  constexpr std::uint64_t num_draws = 256;  // A size needs few digits.
  const DrawnMoments moments = drawn_moments(dispersions, num_draws);
  for (std::size_t i = 0; i < num_drawn; ++i) sizes_[i] = size_of(dispersions, moments, i);
  const std::vector<std::size_t> of_table = table_elements(dispersions);
  for (std::size_t i = 0; i < std::min(of_table.size(), table_columns.size()); ++i) {
    double& size = sizes_[of_table[i]];
    size = 0.0;
    for (const double value : table_columns[i]) size = std::max(size, std::abs(value));
  }
}

double DrawnSizes::of_axis(std::string_view group, std::size_t axis) const {
  return sizes_[draw_group(group).first + axis];
}

double DrawnSizes::of_pair(std::string_view group, std::size_t axis) const {
  const std::size_t first = draw_group(group).first;
  return 0.5 * (sizes_[first + axis] + sizes_[first + 3 + axis]);
}

}  // namespace proofmass
