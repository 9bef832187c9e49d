#pragma once

#include <string>
#include <vector>

#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// SHA-256 over results in run order: two files of one campaign have the same digest, whoever
/// computed the runs, in whatever order they arrived.
///
/// A result is 184 bytes for the ten quantities of MICROSCOPE, little-endian: run index (64 bits),
/// status, draws, rounds (32 bits each), 32 bits of zero, then the truth and the estimate of each
/// quantity (doubles; 0 where they mean nothing, no negative zeros), and the standard errors if the
/// model has any.
///
/// The health of loops has a digest of its own, so that that of the results is the same as of
/// before there was any. Of a result that has it, these are run index, the numbers in the order of
/// ResultSchema::health, cause and session of the loss (32 bits each; 0 unless the run is lost).
class Digest {
 public:
  void add(const RunResult& result);

  /// @pre Called once, at the end.
  [[nodiscard]] ResultDigests finish();

 private:
  Sha256 hash_;
  Sha256 health_hash_;
  std::vector<unsigned char> bytes_;  // Of one result: kept from one to the next.
  bool has_health_ = false;
};

/// Digest of the results in a campaign file, without that of their health.
[[nodiscard]] std::string digest_of(const Store& store);

}  // namespace proofmass::coordinator
