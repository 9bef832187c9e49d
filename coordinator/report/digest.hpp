#pragma once

#include <string>

#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// SHA-256 over results in run order: two files of one campaign have the same digest, whoever
/// computed the runs, in whatever order they arrived.
///
/// A result is 184 bytes, little-endian: run index (64 bits), status, draws, rounds (32 bits each),
/// 32 bits of zero, then ten truths and ten estimates (doubles; 0 where they mean nothing, no
/// negative zeros).
class Digest {
 public:
  void add(const RunResult& result);

  /// 64 hexadecimal digits. @pre Called once, at the end.
  [[nodiscard]] std::string finish();

 private:
  Sha256 hash_;
};

/// Digest of the results in a campaign file.
[[nodiscard]] std::string digest_of(const Store& store);

}  // namespace proofmass::coordinator
