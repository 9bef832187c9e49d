#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::wire {

/// Declares the hidden option `--write-manual DIR`, by which the build makes a program's man page
/// and its completions for bash, zsh and fish. They are written below DIR to the places that they
/// have below the directory `share` of an installation; then the program ends, as after `--help`.
///
/// @param app       Lives as long as the option; everything visible is declared before its
///                  arguments are parsed.
/// @param see_also  Other programs that the man page refers to.
/// @throws Error while the arguments are parsed, if a file cannot be written.
void add_manual_option(CLI::App& app, const std::vector<std::string>& see_also);

}  // namespace proofmass::wire
