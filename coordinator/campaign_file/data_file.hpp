#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "core/error.hpp"

namespace proofmass::coordinator::detail {

/// A file cannot be opened, is no regular file, or is too large; the text is the reason alone.
class UnreadableFile : public Error {
 public:
  using Error::Error;
};

/// What is done with a pipe or a device, which may never end.
enum class Pipes : std::uint8_t {
  refused,
  accepted,  ///< For a file that a user names: `<(make_campaign)`.
};

/// All bytes of a file.
/// @throws UnreadableFile
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, std::size_t size_max,
                                         Pipes pipes);

/// read_text_file() of a file that a user names.
/// @throws DefinitionError `file: reason`.
[[nodiscard]] std::string read_definition_text(const std::filesystem::path& file,
                                               std::size_t size_max, Pipes pipes);

}  // namespace proofmass::coordinator::detail
