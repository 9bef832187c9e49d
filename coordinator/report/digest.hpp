#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// SHA-256 over results in run order: two files of one campaign have the same digest,
/// whichever workers computed the runs and in whatever order they arrived.
///
/// A result of n quantities, m of them with a standard error, is 24 + 16 n + 8 m bytes,
/// little-endian: run index (64 bits), status, draws, rounds (32 bits each), 32 bits of zero, then
/// the truth and the estimate of each quantity (doubles; 0 where they mean nothing, no negative
/// zeros), and the standard errors.
///
/// The health of loops has a digest of its own, so that that of the results is the same as of
/// before there was any. Of a result that has it, these are run index, the numbers in the order of
/// ResultSchema::health, cause and session of the loss (32 bits each; 0 unless the run is lost).
class Digest {
 public:
  explicit Digest(const ResultSchema& schema);

  void add(const RunResult& result);

  /// @pre Called once, at the end.
  [[nodiscard]] ResultDigests finish();

 private:
  std::size_t num_quantities_;
  Sha256 hash_;
  Sha256 health_hash_;
  std::vector<unsigned char> bytes_;  // Of one result: kept from one to the next.
  bool has_health_ = false;
};

/// Digest of the results in a campaign database, without that of their health.
[[nodiscard]] std::string digest_of(const Store& store);

/// What the digest that is stored with a file's statistics says of its results.
enum class DigestCheck : std::uint8_t {
  holds,        ///< It is that of the results.
  not_checked,  ///< It is of fewer results, or there is none yet.
};

/// Holds the results of a file against the digest that is stored with its statistics.
///
/// @param num_results  All results of the file, in the state of the file that is being read.
/// @param digests      Theirs.
/// @throws StoreError `campaign database = x.db (is damaged: ...)` if the digest is of as many
/// results and another one, if it is of more results, if the counts beside it do not add up, or if
/// there are statistics and none is there.
[[nodiscard]] DigestCheck check_digest(const Store& store, std::uint64_t num_results,
                                       const ResultDigests& digests);

/// What one walk over all results of a file tells of them.
struct WalkedResults {
  std::uint64_t num_results = 0;
  std::string digest;
  DigestCheck check = DigestCheck::holds;
};

/// Calls visit(result) for each result of a file, in run order and of one state of the file, and
/// holds them against the stored digest at the end.
/// @throws StoreError as check_digest() and Store::for_each_result() do.
[[nodiscard]] WalkedResults walk_checked(const Store& store,
                                         const std::function<void(const RunResult&)>& visit);

/// To be called before results are added to those of a file: its statistics and their digest are
/// made anew then, and would make a damaged file valid. Reads all results if there is a digest of
/// them all, and otherwise nothing: what was stored since the last one cannot be checked.
/// @throws StoreError as walk_checked() does.
void check_results_before_more(const Store& store);

/// Holds what defines a campaign, its data files and its tables of drawn values against the digest
/// that is stored with them.
/// @throws StoreError `campaign database = x.db (is damaged: ...)`.
void check_definition_digest(const Store& store);

}  // namespace proofmass::coordinator
