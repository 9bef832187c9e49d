#pragma once

#include <string_view>

namespace proofmass::coordinator {

/// A coverage or a confidence that SQL states in per cent, as a fraction. One below 1 % is of no
/// use and would be a fraction where per cent is meant.
/// @param name  Of the argument, for the message.
/// @throws InvalidArgument unless it is in [1, 100).
[[nodiscard]] double fraction_of(std::string_view name, double per_cent);

}  // namespace proofmass::coordinator
