#pragma once

#include <cstdio>
#include <string_view>

namespace proofmass::wire {

/// Tells the user on standard error, as visible_lines(): the text may quote a file or a peer. A
/// failure to write, on a full disk or to a closed terminal, is ignored: answers go to standard
/// output.
void say(std::string_view text) noexcept;

/// Writes to a stream as it is: for displays, which move the cursor.
/// @pre What the text quotes of files and peers has been made visible.
void say_on(std::FILE* stream, std::string_view text) noexcept;

}  // namespace proofmass::wire
