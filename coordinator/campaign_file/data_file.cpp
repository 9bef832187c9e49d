#include "coordinator/campaign_file/data_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/campaign/definition.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator::detail {
namespace {

[[noreturn]] void fail() {
  throw UnreadableFile(fmt::format("cannot be read: {}", std::strerror(errno)));
}

/// So many bytes of a file, or all if it has fewer.
std::string read_beginning(const std::filesystem::path& file, std::size_t size_max, Pipes pipes) {
  // Opening a pipe must not wait for its other end.
  const wire::Descriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat status {};
  if (opened.number() < 0 || ::fstat(opened.number(), &status) != 0) fail();
  if (S_ISDIR(status.st_mode)) throw UnreadableFile("is a directory");
  if (S_ISREG(status.st_mode)) {
    // What the kernel makes up, as in /proc, says that it has no bytes: reading it might wait for
    // ever.
    size_max = std::min(size_max, static_cast<std::size_t>(status.st_size));
  } else if (pipes == Pipes::refused) {
    throw UnreadableFile("is a pipe, a socket or a device");
  } else if (::fcntl(opened.number(), F_SETFL, 0) != 0) {  // Reading waits for who writes.
    fail();
  }
  std::string text(size_max, '\0');
  std::size_t size = 0;
  while (size < size_max) {
    const ssize_t num_read = ::read(opened.number(), text.data() + size, size_max - size);
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) fail();
    if (num_read == 0) break;
    size += static_cast<std::size_t>(num_read);
  }
  text.resize(size);
  return text;
}

}  // namespace

// One byte more than allowed tells a file that is too large, also one without a known size.
std::string read_text_file(const std::filesystem::path& file, std::size_t size_max, Pipes pipes) {
  std::string text = read_beginning(file, size_max + 1, pipes);
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

std::string read_definition_text(const std::filesystem::path& file, std::size_t size_max,
                                 Pipes pipes) {
  try {
    return read_text_file(file, size_max, pipes);
  } catch (const UnreadableFile& error) {
    throw DefinitionError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace proofmass::coordinator::detail
