#include "coordinator/report/missing_estimates.hpp"

#include <fmt/format.h>

#include <array>
#include <string_view>
#include <utility>

#include "core/error.hpp"

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

void Exceedances::add(const RunResult& result) {
  if (!result.has_estimate()) return;
  std::vector<double> errors(objectives_.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = result.error(i);
  ++num_estimated_;
  if (exceeds(requirement_, errors, objectives_)) ++num_exceeding_;
}

ExceedanceCount Exceedances::of(std::uint64_t num_runs) const {
  if (num_estimated_ > num_runs) {
    throw InvalidArgument(
        fmt::format("runs with an estimate = {} (must be at most {})", num_estimated_, num_runs));
  }
  const std::uint64_t num_without_estimate = num_runs - num_estimated_;
  return {.num_runs = num_runs,
          .num_exceedances = num_exceeding_ + num_without_estimate,
          .num_without_estimate = num_without_estimate};
}

}  // namespace proofmass::coordinator
