#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// Whether an export has the drawn values of each run.
enum class DrawColumns : std::uint8_t { left_out, included };

/// `draw_offcentring_m.x`.
/// @param quantity  Index into Model::drawn().
[[nodiscard]] std::string draw_column_name(std::size_t quantity);

/// The columns of drawn values of an export, none or one for each drawn quantity. They are computed
/// anew, as the table `draw` of `proofmass query` is.
class DrawnColumns {
 public:
  /// Reads the campaign if it is needed. Its memory is that of the campaign's table values.
  /// @pre The definition was held against its digest, in the state of the file that is being read.
  /// @throws as stored_campaign_unchecked().
  DrawnColumns(const Store& store, DrawColumns columns);

  /// 0 or the number of drawn quantities.
  [[nodiscard]] std::size_t count() const;

  /// Empty if there are no columns or if all draws of the run were rejected.
  [[nodiscard]] std::vector<double> values_of(RunIndex run) const;

 private:
  std::shared_ptr<const Campaign> campaign_;  ///< Null without columns.
};

}  // namespace proofmass::coordinator
