#include "worker/execution/execution.hpp"

#include <utility>

#include "core/campaign/model.hpp"

namespace proofmass::worker {

std::shared_ptr<const Campaign> Execution::read(Definition definition) const {
  return model().campaign_of(std::move(definition), TableColumns::left_out, "definition");
}

}  // namespace proofmass::worker
