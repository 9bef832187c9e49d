#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// A number ≥ 0 with three significant digits: `0.361`, `7.53`, `49.2`, `1240`; from a million on
/// and below a thousandth `1.2e+06`, which is at most seven characters below 1e99.
[[nodiscard]] std::string measured_figure(double value);

/// Any number in the spelling of measured_figure(), with a minus sign if it is below 0.
[[nodiscard]] std::string signed_figure(double value);

/// A number ≥ 0 that somebody gave, without zeros that say nothing: `7.3`, `2000`.
[[nodiscard]] std::string given_figure(double value);

/// `1,234,567`
[[nodiscard]] std::string grouped(std::uint64_t count);

/// `1 run`, `2 runs`.
[[nodiscard]] std::string counted(std::uint64_t count, std::string_view thing);

/// For people: `42 s`, `3 min 20 s`, `5 h 10 min`, `12 d 4 h`.
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace proofmass::coordinator
