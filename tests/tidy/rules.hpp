#pragma once

#include <string>
#include <vector>

#include "tests/tidy/source_file.hpp"

namespace proofmass::test {

// Each rule yields a line for every violation, `path:line: what`; none if all is well.
using Findings = std::vector<std::string>;

/// core includes only numerics, its parts and those of the model in their order; coordinator and
/// worker never see each other; SQLite, ZeroMQ and generated Protobuf types stay in the few sources
/// that may know them. What runs campaigns knows no model by name: programs choose theirs where
/// they are linked. Includes are written from the root, in tests too, for which nothing else of
/// this holds.
[[nodiscard]] Findings check_layers(const SourceFile& file);

/// Only programs are linked with the library of a model, not the libraries that run campaigns.
[[nodiscard]] Findings check_links(const SourceFile& file);

/// A header begins with `#pragma once`.
[[nodiscard]] Findings check_header_guard(const SourceFile& file);

/// At most 100 columns and 500 lines, lists of files apart.
[[nodiscard]] Findings check_size(const SourceFile& file);

/// Functions of at most 70 lines, from the line of the opening brace to that of the closing one.
[[nodiscard]] Findings check_function_length(const SourceFile& file);

/// Work left open names its issue: `TODO(#12):`.
[[nodiscard]] Findings check_open_work(const SourceFile& file);

/// core calls no function of the C library whose last bit depends on the processor.
[[nodiscard]] Findings check_elementary_functions(const SourceFile& file);

/// Identifiers use the project's words.
[[nodiscard]] Findings check_words(const SourceFile& file);

/// Every .cpp file is named by the CMakeLists.txt of its folder or of one above.
[[nodiscard]] Findings check_all_built(const std::vector<SourceFile>& files);

/// No two headers of the programs define a type of one name in one namespace: the linker would take
/// the destructor of either for both.
[[nodiscard]] Findings check_types_unique(const std::vector<SourceFile>& files);

}  // namespace proofmass::test
