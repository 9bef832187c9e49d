#pragma once

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

/// @throws UnreadableFile if it is a pipe, a socket or a device, which may never end.
void require_regular_file(const std::filesystem::path& file);

/// All bytes of a file.
/// @throws UnreadableFile
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file,
                                         std::uintmax_t size_max);

}  // namespace proofmass::coordinator::detail
