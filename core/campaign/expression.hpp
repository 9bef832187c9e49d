#pragma once

#include <functional>
#include <string_view>

namespace proofmass {

/// True for `sqrt` and `pow`, which are no names of quantities in an expression.
[[nodiscard]] bool is_function(std::string_view name);

/// The value of an expression: numbers, names such as `offcentring_m.x`, + - * /, parentheses, a
/// minus before a term, sqrt(x) and pow(x, n) with a whole number n from -16 to 16. Every operation
/// has the same bits on every processor. Division by 0 and roots of negative numbers give what
/// IEEE 754 says.
///
/// @param value_of  Of a name: letters, digits, `_` and `.`, beginning with a letter.
/// @throws InvalidArgument that names the character, from 1, and what is expected there; and what
///         `value_of` throws.
[[nodiscard]] double evaluate_expression(
    std::string_view text, const std::function<double(std::string_view name)>& value_of);

}  // namespace proofmass
