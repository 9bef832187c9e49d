#include "coordinator/net/definition_cache.hpp"

#include <algorithm>
#include <utility>

namespace proofmass::coordinator {

wire::DefinitionPart DefinitionCache::part(const wire::CampaignRequest& request,
                                           const std::shared_ptr<const Campaign>& definition) {
  auto found = entries_.find(request.campaign);
  if (found != entries_.end() && found->second.definition != definition) {
    size_ -= found->second.encoded.size();
    entries_.erase(found);
    found = entries_.end();
  }
  if (found == entries_.end()) {
    make_room();
    Entry entry{.definition = definition,
                .encoded = wire::EncodedDefinition(definition->definition(TableColumns::left_out))};
    size_ += entry.encoded.size();
    ++num_encoded_;
    found = entries_.emplace(request.campaign, std::move(entry)).first;
  }
  found->second.used = ++num_uses_;
  return found->second.encoded.part(request);
}

void DefinitionCache::make_room() {
  while (size_ > size_max_) {
    const auto oldest = std::min_element(
        entries_.begin(), entries_.end(),
        [](const auto& a, const auto& b) { return a.second.used < b.second.used; });
    size_ -= oldest->second.encoded.size();
    entries_.erase(oldest);
  }
}

}  // namespace proofmass::coordinator
