#include "coordinator/archive/text_output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <system_error>
#include <utility>

#include "coordinator/archive/archive_error.hpp"

namespace proofmass::coordinator {
namespace {

// Makes a file, or a directory's entries, durable; returns an errno, 0 if all is well.
int synchronise(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error_number = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error_number;
}

constexpr std::size_t buffer_size = 1 << 18;

}  // namespace

DraftFile::DraftFile(std::filesystem::path path)
    : path_(std::move(path)),
      draft_(std::filesystem::path(path_).concat(fmt::format(".{}.new", ::getpid()))) {}

DraftFile::~DraftFile() {
  std::error_code ignored;
  if (!is_published_) std::filesystem::remove(draft_, ignored);
}

void DraftFile::publish() {
  if (const int error_number = synchronise(draft_)) fail_to_write(path_, error_number);
  if (std::rename(draft_.c_str(), path_.c_str()) != 0) fail_to_write(path_, errno);
  is_published_ = true;
  (void)synchronise(path_.has_parent_path() ? path_.parent_path() : ".");
}

void fail_to_write(const std::filesystem::path& path, int error_number) {
  throw ArchiveError(fmt::format("output = {} (cannot be written: {})", path.string(),
                                 std::strerror(error_number)));
}

TextOutput::TextOutput(const std::filesystem::path& path) : file_(path) {
  constexpr mode_t mode = 0666;  // Less what the user masks.
  descriptor_ = ::open(file_->draft().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode);
  if (descriptor_ < 0) fail_to_write(path, errno);
}

TextOutput::~TextOutput() {
  if (file_ && descriptor_ >= 0) ::close(descriptor_);
}

void TextOutput::write(std::string_view text) {
  buffer_ += text;
  if (buffer_.size() >= buffer_size) flush();
}

void TextOutput::finish() {
  flush();
  if (!file_) return;
  const int descriptor = descriptor_;
  descriptor_ = -1;
  if (::close(descriptor) != 0) fail_to_write(name(), errno);
  file_->publish();
}

void TextOutput::flush() {
  std::string_view rest = buffer_;
  while (!rest.empty()) {
    const ssize_t size = ::write(descriptor_, rest.data(), rest.size());
    if (size < 0 && errno != EINTR) fail_to_write(name(), errno);
    if (size > 0) rest.remove_prefix(static_cast<std::size_t>(size));
  }
  buffer_.clear();
}

std::filesystem::path TextOutput::name() const {
  return file_ ? file_->path() : std::filesystem::path("-");
}

}  // namespace proofmass::coordinator
