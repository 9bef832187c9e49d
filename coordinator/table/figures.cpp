#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

std::string measured_figure(double value) {
  if (value == 0.0) return "0";
  if (value < 1e-3 || value >= 999'999.5) return fmt::format("{:.1e}", value);
  // Rounding may carry into the next decade: 9.996 is 10.0.
  const double rounded = std::stod(fmt::format("{:.2e}", value));
  const int exponent = static_cast<int>(std::floor(std::log10(rounded)));
  return fmt::format("{:.{}f}", value, std::max(0, 2 - exponent));
}

std::string signed_figure(double value) {
  return fmt::format("{}{}", value < 0.0 ? "-" : "", measured_figure(std::abs(value)));
}

std::string given_figure(double value) {
  std::string figure = measured_figure(value);
  const bool has_fraction =
      figure.find('.') != std::string::npos && figure.find('e') == std::string::npos;
  if (!has_fraction) return figure;
  figure.erase(figure.find_last_not_of('0') + 1);
  if (figure.back() == '.') figure.pop_back();
  return figure;
}

std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t place = digits.size(); place > 3; place -= 3) digits.insert(place - 3, 1, ',');
  return digits;
}

std::string counted(std::uint64_t count, std::string_view thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

std::string duration_text(double seconds) {
  constexpr double longest_s = 9999.0 * 86400.0;
  const auto total = static_cast<std::uint64_t>(std::ceil(std::clamp(seconds, 0.0, longest_s)));
  if (total < 60) return fmt::format("{} s", total);
  if (total < 3600) return fmt::format("{} min {} s", total / 60, total % 60);
  if (total < 86400) return fmt::format("{} h {} min", total / 3600, total % 3600 / 60);
  return fmt::format("{} d {} h", total / 86400, total % 86400 / 3600);
}

}  // namespace proofmass::coordinator
