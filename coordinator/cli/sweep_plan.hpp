#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/comparison.hpp"

namespace proofmass::coordinator {

/// Most campaigns of one sweep.
inline constexpr std::size_t num_swept_max = 1000;

/// A key of a campaign file and the values that it gets, one after the other.
struct VariedKey {
  std::string key;                  ///< `noise.scale`.
  std::vector<std::string> values;  ///< As in a campaign file: `0.5`, `"first_order"`, `[1, 2]`.
};

/// Reads `noise.scale=0.5,1,2`. A comma within brackets, braces or quotes separates no values.
/// @throws UsageError `vary = noise.scale=1,1 (has the value 1 twice)`, or if there is no key, no
///         value or an empty one.
[[nodiscard]] VariedKey parse_varied(std::string_view text);

/// The values of all varied keys in one campaign of a sweep, in the order of the keys.
using SweptValues = std::vector<KeyText>;

/// Every combination of the values; the last key varies fastest.
/// @throws UsageError if a key is named twice, if there are fewer than two combinations, or more
///         than num_swept_max.
[[nodiscard]] std::vector<SweptValues> combinations(std::span<const VariedKey> keys);

/// `noise.scale=0.5,environment.drag=0`.
[[nodiscard]] std::string text_of(const SweptValues& values);

/// File name of a campaign of a sweep: `mine-noise.scale=0.5.db`. The same values always have the
/// same name, without quotes. If another character is no letter or digit and none of `.,=+-_`, or
/// if the name would have more than 200 bytes, it ends in a part of a digest of the values.
/// @param stem  Of the campaign file.
[[nodiscard]] std::string sweep_file_name(std::string_view stem, const SweptValues& values);

/// Names the campaigns of a sweep in tables by their values, if these are short, else by letters.
[[nodiscard]] MemberNames sweep_names(std::span<const SweptValues> campaigns);

}  // namespace proofmass::coordinator
