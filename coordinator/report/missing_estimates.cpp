#include "coordinator/report/missing_estimates.hpp"

#include <fmt/format.h>

#include <array>
#include <string_view>
#include <utility>

namespace proofmass::coordinator {

void MissingEstimates::add(const RunResult& result) {
  if (result.status == RunStatus::not_finite) ++num_not_finite;
  if (result.status == RunStatus::no_draw) ++num_no_draw;
  if (result.status == RunStatus::lost) ++num_lost;
}

std::uint64_t MissingEstimates::total() const {
  return num_not_finite + num_no_draw + num_lost + num_given_up;
}

std::string reasons_text(const MissingEstimates& missing) {
  const std::array<std::pair<std::uint64_t, std::string_view>, 4> reasons{
      {{missing.num_not_finite, "not finite"},
       {missing.num_no_draw, "without draw"},
       {missing.num_lost, "lost"},
       {missing.num_given_up, "given up"}}};
  std::string text;
  for (const auto& [count, reason] : reasons) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, reason);
  }
  return text;
}

}  // namespace proofmass::coordinator
