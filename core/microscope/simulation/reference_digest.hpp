#pragma once

#include <cstdint>
#include <optional>

#include "core/math/instruction_set.hpp"
#include "core/model.hpp"

namespace proofmass {

/// Digest of the results of a short fixed campaign: the same number from every sound build and
/// processor of one model_version. A coordinator refuses workers that come to another one, before
/// they compute anything that counts. Passes through every kernel of the set; takes some 40 ms
/// with AVX-512.
///
/// @param set  One of available_instruction_sets().
[[nodiscard]] std::uint64_t reference_digest(InstructionSet set);

/// Model::prove(): the digest by a device's kernels, in the launches of every campaign.
[[nodiscard]] std::optional<Model::DeviceProof> prove_device(Device& device);

}  // namespace proofmass
