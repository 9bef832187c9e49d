#include "worker/execution/execution.hpp"

#include <utility>

#include "core/definition/campaign_definition.hpp"

namespace proofmass::worker {

std::shared_ptr<const Campaign> Execution::read(Definition definition) const {
  return std::make_shared<const Campaign>(
      campaign_of(std::move(definition), TableColumns::left_out));
}

}  // namespace proofmass::worker
