#pragma once

#include <string>
#include <string_view>

#include "proto/command_line/described_program.hpp"

namespace proofmass::wire {

// Scripts that complete the command line of a program: commands, options, file names where a value
// is a file, and the words of options that take one of several.

/// To be sourced, e.g. by bash-completion from share/bash-completion/completions/PROGRAM.
[[nodiscard]] std::string bash_completion(const DescribedCommand& program);

/// For a directory of `fpath`, under the name _PROGRAM.
[[nodiscard]] std::string zsh_completion(const DescribedCommand& program);

/// For share/fish/vendor_completions.d/PROGRAM.fish.
[[nodiscard]] std::string fish_completion(const DescribedCommand& program);

/// The text in single quotes, as one word of bash or zsh.
[[nodiscard]] std::string shell_quoted(std::string_view text);

}  // namespace proofmass::wire
