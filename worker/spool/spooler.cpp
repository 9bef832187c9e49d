#include "worker/spool/spooler.hpp"

namespace proofmass::worker {

Spooler::Spooler(Spool& spool) : spool_(spool) {
  for (const wire::LeasedResult& result : spool.former_results()) spooled_.insert(key_of(result));
}

Spooler::RunKey Spooler::key_of(const wire::LeasedResult& result) {
  return {result.campaign, result.computed.result.run};
}

std::optional<std::string> Spooler::look(const std::vector<wire::LeasedResult>& unacknowledged) {
  if (unacknowledged.empty()) {
    spool_.clear();
    spooled_.clear();
    seen_.clear();
    return std::nullopt;
  }
  std::vector<wire::LeasedResult> old;
  std::set<RunKey> seen;
  for (const wire::LeasedResult& result : unacknowledged) {
    const RunKey key = key_of(result);
    seen.insert(key);
    if (seen_.contains(key) && !spooled_.contains(key)) old.push_back(result);
  }
  seen_ = std::move(seen);
  return append(old);
}

std::optional<std::string> Spooler::finish(const std::vector<wire::LeasedResult>& unacknowledged) {
  (void)look(unacknowledged);
  return look(unacknowledged);
}

std::optional<std::string> Spooler::append(const std::vector<wire::LeasedResult>& results) {
  if (results.empty()) return std::nullopt;
  if (auto reason = spool_.append(results)) return reason;
  for (const wire::LeasedResult& result : results) spooled_.insert(key_of(result));
  return std::nullopt;
}

}  // namespace proofmass::worker
