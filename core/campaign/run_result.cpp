#include "core/campaign/run_result.hpp"

#include <fmt/format.h>

#include "core/error.hpp"

namespace proofmass {

void require_in_range(const RunResult& result) {
  const auto require = [&](std::string_view kind, const ParameterInfo& info, double value) {
    if (is_in_range(value)) return;
    throw Error(fmt::format("{}_{}{} of run {} = {} (must be in [{}, {}])", kind, info.name,
                            info.unit_suffix, result.run.value, value, -magnitude_max,
                            magnitude_max));
  };
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    if (result.has_truth()) require("truth", info, result.truth[i]);
    if (result.has_estimate()) require("estimate", info, result.estimate[i]);
  }
}

}  // namespace proofmass
