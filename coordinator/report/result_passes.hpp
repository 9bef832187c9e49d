#pragma once

#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// Something that is computed from all results of a campaign, which are seen in passes: the same
/// ones each time, in run order. See read_results().
class ResultPasses {
 public:
  virtual ~ResultPasses() = default;

  /// @param result  Its numbers are in range.
  virtual void add(const RunResult& result) = 0;
  /// @return True if another pass is needed; add() is not called any more otherwise.
  [[nodiscard]] virtual bool end_pass() = 0;
};

}  // namespace proofmass::coordinator
