#include "worker/spool/spooler.hpp"

namespace proofmass::worker {

Spooler::Spooler(Spool& spool) : spool_(spool) {
  for (const KeptResult& result : spool.former_results()) spooled_.insert(key_of(result));
}

Spooler::RunKey Spooler::key_of(const KeptResult& result) {
  return {result.campaign, result.computed.result.run};
}

std::optional<std::string> Spooler::look(const std::vector<KeptResult>& unacknowledged) {
  if (unacknowledged.empty()) {
    spool_.clear();
    spooled_.clear();
    seen_.clear();
    return std::nullopt;
  }
  std::vector<KeptResult> old;
  std::set<RunKey> seen;
  for (const KeptResult& result : unacknowledged) {
    const RunKey key = key_of(result);
    seen.insert(key);
    if (seen_.contains(key) && !spooled_.contains(key)) old.push_back(result);
  }
  seen_ = std::move(seen);
  return append(old);
}

std::optional<std::string> Spooler::finish(const std::vector<KeptResult>& unacknowledged) {
  (void)look(unacknowledged);
  return look(unacknowledged);
}

std::optional<std::string> Spooler::append(const std::vector<KeptResult>& results) {
  if (results.empty()) return std::nullopt;
  if (auto reason = spool_.append(results)) return reason;
  for (const KeptResult& result : results) spooled_.insert(key_of(result));
  return std::nullopt;
}

}  // namespace proofmass::worker
