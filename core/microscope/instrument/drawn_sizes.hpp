#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "core/microscope/instrument/drawn_quantities.hpp"

namespace proofmass {

/// The largest magnitudes of drawn quantities that their laws allow; of one that follows a normal
/// law, or is derived from others, one draw in 370 is beyond.
class DrawnSizes {
 public:
  /// @param table_columns  Of the quantities with the law `table`, in the order of
  ///                       table_elements(); without its column a quantity has its nominal law.
  explicit DrawnSizes(const DispersionSet& dispersions,
                      const std::vector<std::vector<double>>& table_columns = {});

  /// Of a vector's element.
  [[nodiscard]] double of_axis(std::string_view group, std::size_t axis) const;
  /// Of half the sum, or the difference, of both sensors' along or about an axis.
  [[nodiscard]] double of_pair(std::string_view group, std::size_t axis) const;

 private:
  DrawnValues sizes_{};
};

}  // namespace proofmass
