#pragma once

#include <string>

#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

/// The shortest text that reads back as the same double: `0.1`, `1e+20`, `-0`, `inf`.
[[nodiscard]] std::string shortest_text(double value);

/// Bytes as SQL writes them: `x'00ff'`.
[[nodiscard]] std::string blob_text(const Blob& blob);

/// Numbers in shortest form, text as it is, bytes as blob_text(), NULL as nothing.
[[nodiscard]] std::string cell_text(const Cell& cell);

[[nodiscard]] bool is_number(const Cell& cell);

}  // namespace proofmass::coordinator
