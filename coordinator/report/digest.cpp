#include "coordinator/report/digest.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <concepts>
#include <optional>

namespace proofmass::coordinator {
namespace {

/// Appends the bytes of numbers.
class Layout {
 public:
  explicit Layout(std::vector<unsigned char>& bytes) : bytes_(bytes) { bytes_.clear(); }

  template <std::unsigned_integral Integer>
  void put(Integer value) {
    std::array<unsigned char, sizeof(value)> bytes{};
    for (std::size_t i = 0; i < sizeof(value); ++i) {
      bytes[i] = static_cast<unsigned char>(value >> (8 * i));
    }
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }

  // Adding zero takes the sign from a negative zero, which SQLite does not keep.
  void put(double value) { put(std::bit_cast<std::uint64_t>(value + 0.0)); }

  /// As many as there are; zeros where they mean nothing.
  void put(const std::vector<double>& values, bool have_meaning, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) put(have_meaning ? values[i] : 0.0);
  }

 private:
  std::vector<unsigned char>& bytes_;
};

}  // namespace

Digest::Digest(const ResultSchema& schema) : num_quantities_(schema.quantities.size()) {}

void Digest::add(const RunResult& result) {
  Layout layout(bytes_);
  layout.put(result.run.value);
  layout.put(static_cast<std::uint32_t>(result.status));
  layout.put(result.num_draws);
  layout.put(result.num_rounds);
  layout.put(std::uint32_t{0});
  layout.put(result.truth, result.has_truth(), num_quantities_);
  layout.put(result.estimate, result.has_estimate(), num_quantities_);
  layout.put(result.standard_error, true, result.standard_error.size());
  layout.put(result.fit, true, result.fit.size());
  layout.put(result.correlations, true, result.correlations.size());
  hash_.add(bytes_);

  if (result.health.empty()) return;
  has_health_ = true;
  Layout of_health(bytes_);
  of_health.put(result.run.value);
  of_health.put(result.health, true, result.health.size());
  const Loss loss = result.status == RunStatus::lost ? result.loss : Loss{};
  of_health.put(loss.cause);
  of_health.put(loss.session);
  health_hash_.add(bytes_);
}

ResultDigests Digest::finish() {
  ResultDigests digests{.results = hash_.finish(), .health = {}};
  if (has_health_) digests.health = health_hash_.finish();
  return digests;
}

std::string digest_of(const Store& store) {
  Digest digest(store.schema());
  store.for_each_result([&](const RunResult& result) { digest.add(result); });
  return digest.finish().results;
}

namespace {

/// What is stored with the statistics of all these results; empty if that is of fewer results, or
/// not there yet.
std::optional<Summary> summary_of_all(const Store& store, std::uint64_t num_results) {
  std::optional<Summary> summary = store.summary();
  if (!summary) {
    // Both are written in one transaction.
    if (store.has_statistics()) store.refuse_as_damaged("its statistics are there without summary");
    return std::nullopt;
  }
  const std::uint64_t num_counted = summary->num_estimated + summary->num_not_converged +
                                    summary->num_not_finite + summary->num_no_draw +
                                    summary->num_lost;
  if (summary->num_finished != num_counted) {
    store.refuse_as_damaged(fmt::format("summary.num_finished is {} and its kinds are {}",
                                        summary->num_finished, num_counted));
  }
  if (num_results < summary->num_finished) {
    store.refuse_as_damaged(fmt::format("it has {} results, and its statistics are of {}",
                                        num_results, summary->num_finished));
  }
  if (num_results > summary->num_finished) return std::nullopt;
  return summary;
}

}  // namespace

DigestCheck check_digest(const Store& store, std::uint64_t num_results,
                         const ResultDigests& digests) {
  const std::optional<Summary> summary = summary_of_all(store, num_results);
  if (!summary) return DigestCheck::not_checked;
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
    Digest digest(store.schema());
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

void check_results_before_more(const Store& store) {
  store.read_one_state([&] {
    if (!summary_of_all(store, num_runs_in(store.finished_runs()))) return;
    (void)walk_checked(store, [](const RunResult&) {});
  });
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
