#pragma once

#include <cstdint>
#include <string_view>

namespace proofmass::wire {

/// FNV-1a, 64 bits: tells whether bytes are whole. It protects against accidents, not malice.
[[nodiscard]] std::uint64_t checksum(std::string_view bytes);

}  // namespace proofmass::wire
