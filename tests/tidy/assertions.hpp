#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tests/tidy/rules.hpp"
#include "tests/tidy/source_file.hpp"

namespace proofmass::test {

/// A PROOFMASS_EXPECT of the programs.
struct Assertion {
  std::string path;
  std::string condition;  ///< In one line.

  auto operator<=>(const Assertion&) const = default;
};

/// Those of a file, in its order. PROOFMASS_KERNEL_EXPECT is another thing.
[[nodiscard]] std::vector<Assertion> assertions_in(const SourceFile& file);

/// Holds the assertions of the programs against a table, a line each:
///
///     path | condition | why no byte of a peer or a file can make it false
///
/// A condition that a file has several times stands there once, as `3 x condition`; `*` as
/// condition is all of a file. Lines that begin with `#` are comments.
///
/// @return A line for each assertion that is not in the table or has no reason there, and for each
///         line of the table whose assertion is gone.
[[nodiscard]] Findings check_assertions(const std::vector<SourceFile>& files,
                                        std::string_view table);

}  // namespace proofmass::test
