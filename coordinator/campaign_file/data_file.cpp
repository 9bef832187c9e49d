#include "coordinator/campaign_file/data_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/campaign/definition.hpp"
#include "proto/text/byte_order_mark.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// Closes a file at the end of a scope.
class OpenFile {
 public:
  // Opening a pipe must not wait for its other end.
  explicit OpenFile(const std::filesystem::path& file)
      : descriptor_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {
    if (descriptor_ < 0) fail();
  }
  ~OpenFile() { ::close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  [[nodiscard]] struct stat status() const {
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0) fail();
    return status;
  }

  /// A pipe to which nobody writes has ended.
  void wait_for_bytes() const {
    if (::fcntl(descriptor_, F_SETFL, 0) != 0) fail();
  }

  [[nodiscard]] std::string read(std::size_t size_max) const {
    std::string text(size_max, '\0');
    std::size_t size = 0;
    while (size < size_max) {
      const ssize_t num_read = ::read(descriptor_, text.data() + size, size_max - size);
      if (num_read < 0 && errno == EINTR) continue;
      if (num_read < 0) fail();
      if (num_read == 0) break;
      size += static_cast<std::size_t>(num_read);
    }
    text.resize(size);
    return text;
  }

 private:
  [[noreturn]] static void fail() {
    throw UnreadableFile(fmt::format("cannot be read: {}", std::strerror(errno)));
  }

  int descriptor_;
};

}  // namespace

// What the kernel makes up, as in /proc, says that it has no bytes: reading it might wait for ever.
std::string read_beginning(const std::filesystem::path& file, std::size_t size_max, Pipes pipes) {
  const OpenFile opened(file);
  const struct stat status = opened.status();
  if (S_ISREG(status.st_mode)) {
    return opened.read(std::min(size_max, static_cast<std::size_t>(status.st_size)));
  }
  if (S_ISDIR(status.st_mode)) throw UnreadableFile("is a directory");
  if (pipes == Pipes::refused) throw UnreadableFile("is a pipe, a socket or a device");
  opened.wait_for_bytes();
  return opened.read(size_max);
}

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

std::string read_toml_text(const std::filesystem::path& file, std::size_t size_max) {
  try {
    return read_text_file(file, size_max, Pipes::refused);
  } catch (const UnreadableFile& error) {
    throw DefinitionError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace proofmass::coordinator::detail
