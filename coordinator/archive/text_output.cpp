#include "coordinator/archive/text_output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>

namespace proofmass::coordinator {
namespace {

constexpr std::size_t buffer_size = 1 << 18;

}  // namespace

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
