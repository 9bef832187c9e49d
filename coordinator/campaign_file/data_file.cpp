#include "coordinator/campaign_file/data_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <system_error>

#include "proto/text/byte_order_mark.hpp"

namespace proofmass::coordinator::detail {

void require_regular_file(const std::filesystem::path& file) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  if (std::filesystem::is_other(status)) throw UnreadableFile("is a pipe, a socket or a device");
}

std::string read_text_file(const std::filesystem::path& file, std::uintmax_t size_max) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) throw UnreadableFile("is a directory");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw UnreadableFile("cannot be read: " + std::generic_category().message(errno));
  }
  // One byte more than allowed tells a file that is too large, also one without a known size.
  std::string text(static_cast<std::size_t>(size_max) + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) throw UnreadableFile("cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > size_max) {
    throw UnreadableFile(fmt::format("is larger than {} bytes", size_max));
  }
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    throw UnreadableFile("is UTF-16; save it as UTF-8");
  }
  text.erase(0, text.size() - wire::without_byte_order_mark(text).size());
  text.shrink_to_fit();
  return text;
}

}  // namespace proofmass::coordinator::detail
