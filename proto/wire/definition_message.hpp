#pragma once

#include "core/campaign/definition.hpp"

namespace proofmass::proto {
class Definition;
}  // namespace proofmass::proto

namespace proofmass::wire::detail {

/// `message` is empty at first.
void write_definition(const Definition& definition, proto::Definition& message);

/// @throws Error if there is too much of anything, rows are not whole, or a number is not finite.
[[nodiscard]] Definition read_definition(const proto::Definition& message);

}  // namespace proofmass::wire::detail
