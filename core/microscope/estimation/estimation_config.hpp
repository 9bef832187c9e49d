#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace proofmass {

/// Position in the list of core/microscope/estimation/methods.cpp, from 1; `hardy2013` is the
/// first.
enum class EstimationMethod : std::uint8_t {};
/// What an estimation round subtracts of what the round before found, see estimate_hardy2013().
enum class Correction : std::uint8_t { first_order = 1, second_order = 2, hardy2013 = 3 };

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(EstimationMethod);
[[nodiscard]] std::span<const std::string_view> names_of(Correction);

/// How the parameters are estimated from the sessions of a run.
struct EstimationConfig {
  EstimationMethod method{1};  ///< `hardy2013`.
  Correction correction = Correction::second_order;
  double transient_s = 1000.0;  ///< Filtered record dropped at a session's start.
  double band_ratio = 3.0;      ///< Band-pass from f/ratio to f·ratio.
  double convergence = 0.01;    ///< Stop when no estimate moves by this part of its objective.
  std::int64_t num_rounds_max = 10;
};

}  // namespace proofmass
