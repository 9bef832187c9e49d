#include "coordinator/report/exceedances.hpp"

#include <fmt/format.h>

#include "core/error.hpp"

namespace proofmass::coordinator {

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
