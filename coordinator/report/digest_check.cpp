#include "coordinator/report/digest_check.hpp"

#include <fmt/format.h>

#include <optional>

#include "coordinator/report/digest.hpp"

namespace proofmass::coordinator {

DigestCheck check_digest(const Store& store, std::uint64_t num_results,
                         const ResultDigests& digests) {
  const std::optional<Summary> summary = store.summary();
  if (!summary) {
    // Both are written in one transaction.
    if (store.has_statistics()) store.refuse_as_damaged("its statistics are there without summary");
    return DigestCheck::not_checked;
  }
  const std::uint64_t num_counted =
      summary->num_estimated + summary->num_not_finite + summary->num_no_draw + summary->num_lost;
  if (summary->num_finished != num_counted) {
    store.refuse_as_damaged(fmt::format("summary.num_finished is {} and its kinds are {}",
                                        summary->num_finished, num_counted));
  }
  if (num_results < summary->num_finished) {
    store.refuse_as_damaged(fmt::format("it has {} results, and its statistics are of {}",
                                        num_results, summary->num_finished));
  }
  if (num_results > summary->num_finished) return DigestCheck::not_checked;
  const auto require_same = [&](const std::string& now, const std::string& stored,
                                const char* what) {
    if (now == stored) return;
    store.refuse_as_damaged(fmt::format("the digest of {} {} results is {} and not {}, as stored",
                                        what, num_results, now.empty() ? "none" : now,
                                        stored.empty() ? "none" : stored));
  };
  require_same(digests.results, summary->digests.results, "its");
  require_same(digests.health, summary->digests.health, "the health of its");
  return DigestCheck::holds;
}

WalkedResults walk_checked(const Store& store, const std::function<void(const RunResult&)>& visit) {
  WalkedResults walked;
  store.read_one_state([&] {
    Digest digest;
    store.for_each_result([&](const RunResult& result) {
      visit(result);
      digest.add(result);
      ++walked.num_results;
    });
    const ResultDigests digests = digest.finish();
    walked.digest = digests.results;
    walked.check = check_digest(store, walked.num_results, digests);
  });
  return walked;
}

void check_definition_digest(const Store& store) {
  const std::string stored = store.table_digest();
  if (stored.empty()) return;
  const std::string computed = store.computed_table_digest();
  if (computed == stored) return;
  store.refuse_as_damaged(
      fmt::format("the digest of its definition is {} and not {}, as stored", computed, stored));
}

}  // namespace proofmass::coordinator
